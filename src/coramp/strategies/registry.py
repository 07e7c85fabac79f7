"""All strategies by name."""

from coramp.errors import CorampError
from coramp.strategies.base import Strategy
from coramp.strategies.mainline_priority import MainlinePriority
from coramp.strategies.ramp_priority import RampPriority
from coramp.strategies.uncontrolled import Uncontrolled

_STRATEGIES: dict[str, type[Strategy]] = {}


def register(strategy: type[Strategy], *, replace: bool = False) -> None:
    """Adds a strategy, for all that is run from now on in this process.

    ``replace`` lets it take the place of one of the same name that was added before, as a notebook
    does whose cell is run again. Raises CorampError if its name is taken, by one of coramp's own
    even with ``replace``: their names stand for what was measured.
    """
    known = _STRATEGIES.get(strategy.name)
    if known in _OURS:
        raise CorampError(
            f"strategy: {strategy.name!r} is coramp's own and cannot be registered twice; "
            "use another name"
        )
    if known is not None and not replace:
        raise CorampError(
            f"strategy: {strategy.name!r} is registered twice; use another name, or replace=True"
        )
    _STRATEGIES[strategy.name] = strategy


_OURS: tuple[type[Strategy], ...] = (MainlinePriority, RampPriority, Uncontrolled)
for _strategy in _OURS:
    _STRATEGIES[_strategy.name] = _strategy


def strategies() -> dict[str, type[Strategy]]:
    """Returns all registered strategies by name, in the order of registration."""
    return dict(_STRATEGIES)


def strategy_named(name: str) -> type[Strategy]:
    """Returns the strategy of that name; raises CorampError if there is none."""
    if name not in _STRATEGIES:
        raise CorampError(f"strategy: there is no {name!r}; allowed are {', '.join(_STRATEGIES)}")
    return _STRATEGIES[name]
