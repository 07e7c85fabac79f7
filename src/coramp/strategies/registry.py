"""All strategies by name."""

from coramp.errors import CorampError
from coramp.strategies.base import Strategy
from coramp.strategies.mainline_priority import MainlinePriority
from coramp.strategies.ramp_priority import RampPriority
from coramp.strategies.uncontrolled import Uncontrolled

_STRATEGIES: dict[str, type[Strategy]] = {}


def register(strategy: type[Strategy]) -> None:
    """Adds a strategy; raises CorampError if its name is taken."""
    if strategy.name in _STRATEGIES:
        raise CorampError(f"strategy: {strategy.name!r} is registered twice; use another name")
    _STRATEGIES[strategy.name] = strategy


for _strategy in (MainlinePriority, RampPriority, Uncontrolled):
    register(_strategy)


def strategies() -> dict[str, type[Strategy]]:
    """Returns all registered strategies by name, in the order of registration."""
    return dict(_STRATEGIES)


def strategy_named(name: str) -> type[Strategy]:
    """Returns the strategy of that name; raises CorampError if there is none."""
    if name not in _STRATEGIES:
        raise CorampError(f"strategy: there is no {name!r}; allowed are {', '.join(_STRATEGIES)}")
    return _STRATEGIES[name]
