"""All strategies by name: coramp's own, those of installed packages, those of this process.

A package adds its own by an entry point of the group ``coramp.strategies``.
"""

from functools import cache
from importlib import metadata

from coramp.errors import CorampError, printable
from coramp.strategies.alinea import Alinea
from coramp.strategies.base import Strategy
from coramp.strategies.dp_sequence import DpSequence
from coramp.strategies.fifo_optimal_control import FifoOptimalControl
from coramp.strategies.game import Game
from coramp.strategies.hero import Hero
from coramp.strategies.mainline_priority import MainlinePriority
from coramp.strategies.milp_sequence import MilpSequence
from coramp.strategies.mixed_slots import MixedSlots
from coramp.strategies.ocbf import Ocbf
from coramp.strategies.ramp_priority import RampPriority
from coramp.strategies.slots import Slots
from coramp.strategies.uncontrolled import Uncontrolled
from coramp.strategies.virtual_platoon import VirtualPlatoon

GROUP = "coramp.strategies"
OURS = "coramp"
_STRATEGIES: dict[str, type[Strategy]] = {}
DRIVERS_ALONE = frozenset(
    {"driver", "drivers", "human", "humans", "sumo", "none", "nothing", "no-control", "baseline"}
    | {"paper", "fair", "credible"}
)
"""What drivers whom nobody controls are also called, populations of them included."""


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


_OURS: tuple[type[Strategy], ...] = (
    MainlinePriority,
    RampPriority,
    FifoOptimalControl,
    DpSequence,
    MilpSequence,
    Game,
    VirtualPlatoon,
    Ocbf,
    Slots,
    MixedSlots,
    Alinea,
    Hero,
    Uncontrolled,
)
for _strategy in _OURS:
    _STRATEGIES[_strategy.name] = _strategy


def strategies() -> dict[str, type[Strategy]]:
    """Returns all strategies by name: ours, those registered, those of installed packages.

    A package whose strategy cannot be loaded is left out; ``broken_plugins`` says why.
    """
    installed = {name: found for name, (found, _) in _installed().items() if found is not None}
    return {**_STRATEGIES, **{k: v for k, v in installed.items() if k not in _STRATEGIES}}


def origin_of(name: str) -> str:
    """Returns where a strategy comes from: coramp, a package with its version, or this process."""
    known = _STRATEGIES.get(name)
    if known in _OURS:
        return OURS
    return "this process" if known is not None else _installed()[name][1]


def broken_plugins() -> list[str]:
    """Returns a line for each installed strategy that cannot be loaded."""
    return [told for found, told in _installed().values() if found is None]


def strategy_named(name: str) -> type[Strategy]:
    """Returns the strategy of that name; raises CorampError if there is none, or it is broken."""
    if name in _STRATEGIES:
        return _STRATEGIES[name]
    found, told = _installed().get(name, (None, ""))
    if found is not None:
        return found
    if told:
        raise CorampError(told)
    hint = (
        f"; drivers whom nobody controls are {Uncontrolled.name!r}"
        if name.lower() in DRIVERS_ALONE
        else ""
    )
    raise CorampError(
        f"strategy: there is no {name!r}; allowed are {', '.join(strategies())}{hint}"
    )


@cache
def _installed() -> dict[str, tuple[type[Strategy] | None, str]]:
    """Strategies of installed packages with their origin, or None with what is wrong."""
    found: dict[str, tuple[type[Strategy] | None, str]] = {}
    for point in metadata.entry_points(group=GROUP):
        package = point.dist
        origin = f"{package.name} {package.version}" if package is not None else point.value
        try:
            loaded = point.load()
            reason = _wrong_with(loaded, point.name)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - a package may raise anything, or exit
            reason = f"{type(error).__name__}: {error}"
        told = printable(f"strategy {point.name} of {origin}: {reason}")
        found[printable(point.name)] = (None, told) if reason else (loaded, origin)
    return found


def _wrong_with(loaded: object, name: str) -> str:
    lacking = [
        part for part in ("name", "summary", "cooperative", "decide") if not hasattr(loaded, part)
    ]
    if not isinstance(loaded, type) or lacking:
        return f"is no strategy: it lacks {', '.join(lacking) or 'a class'}"
    if not isinstance(loaded.summary, str):  # type: ignore[attr-defined]
        return "its summary is no text"
    if printable(name) != name:
        return "its name has characters that cannot be printed"
    if loaded.name != name:  # type: ignore[attr-defined]
        return f"calls itself {loaded.name!r}"  # type: ignore[attr-defined]
    return f"{name} is coramp's own name" if name in _STRATEGIES else ""
