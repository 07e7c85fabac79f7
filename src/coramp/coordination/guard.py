"""Holds a strategy that is not coramp's own to the interface: what it may answer, and how long."""

import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol, cast

import numpy as np

from coramp._kernel import compiling
from coramp.core.fleet import MAX_CHANGED
from coramp.core.trajectory import MAX_PIECES
from coramp.errors import CorampError
from coramp.strategies.base import (
    Decider,
    Decision,
    DriveWithAcceleration,
    FollowTrajectory,
    Memory,
    ReleaseToDriver,
    SetRampSignal,
    View,
    is_metered,
    period_of,
)
from coramp.strategies.registry import OURS, origin_of, strategy_named

LONGEST_DECISION_S = 10.0
"""Wall time after which a decision counts as one that never comes; compiling does not count."""
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 0.01, 3600.0
MOST_AT_ONCE = 10_000
"""So many decisions at one time are a strategy that wakes itself without end."""


class TooLong(BaseException):
    """A decision takes too long; no ``except Exception`` of a strategy catches it."""


class Guardable(Decider, Protocol):
    """Whatever answers like a strategy and has a name."""

    @property
    def name(self) -> str:
        """What to call it in errors."""
        ...


class Guarded:
    """A strategy whose mistakes become a CorampError that names it, in one line."""

    def __init__(self, strategy: Guardable, longest_s: float = LONGEST_DECISION_S) -> None:
        self.name = strategy.name
        self.period_s = _period_checked(strategy)
        self.metered = is_metered(strategy)
        self._strategy = strategy
        self._longest_s = longest_s
        self._time_s = -1.0
        self._at_once = 0

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns what the strategy decides; raises CorampError where that cannot be used."""
        self._at_once = self._at_once + 1 if view.time_s == self._time_s else 0
        self._time_s = view.time_s
        try:
            with time_limit(self._longest_s):
                decision = self._strategy.decide(view, memory)
        except TooLong:
            problem = f"takes longer than {self._longest_s:g} s to decide"
        except Exception as error:  # noqa: BLE001 - it may raise anything
            problem = f"raises {type(error).__name__}: {error}"
        else:
            problem = _wrong_with(decision, view)
        if self._at_once > MOST_AT_ONCE:
            problem = "wakes itself without end"
        if problem:
            raise CorampError(f"strategy {self.name}: at {view.time_s:.1f} s it {problem}")
        return decision


def strategy_to_run(name: str, settings: Mapping[str, Any] | None = None) -> Decider:
    """Returns a strategy by name, with its parameters, guarded unless it is coramp's own.

    Raises CorampError if there is none such, or it cannot be made.
    """
    chosen: Any = strategy_named(name)
    if origin_of(name) == OURS:
        return cast("Decider", chosen(**(settings or {})))
    try:
        return Guarded(chosen(**(settings or {})))
    except CorampError:
        raise
    except Exception as error:
        raise CorampError(f"strategy {name}: raises {type(error).__name__}: {error}") from error


@contextmanager
def time_limit(longest_s: float) -> Iterator[None]:
    """Raises TooLong inside the block after that time; only the main thread can be interrupted."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def give_up(*_: object) -> None:
        if compiling():
            signal.setitimer(signal.ITIMER_REAL, longest_s)
            return
        raise TooLong

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, longest_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _period_checked(strategy: Guardable) -> float | None:
    period_s: Any = period_of(strategy)
    if period_s is None:
        return None
    if isinstance(period_s, int | float) and SHORTEST_PERIOD_S <= period_s <= LONGEST_PERIOD_S:
        return float(period_s)
    raise CorampError(
        f"strategy {strategy.name}: period_s: {period_s!r} cannot be; allowed is a number from "
        f"{SHORTEST_PERIOD_S:g} to {LONGEST_PERIOD_S:g}"
    )


def _wrong_with(decision: Any, view: View) -> str:
    if not isinstance(decision, Decision):
        return f"returns {type(decision).__name__}; allowed is a Decision"
    live = set(view.fleet.live.tolist())
    moved = [command for command in decision.commands if isinstance(command, FollowTrajectory)]
    if len(moved) > MAX_CHANGED:
        return f"commands {len(moved)} trajectories; allowed are {MAX_CHANGED} at a time"
    rows = [command.row for command in decision.commands if hasattr(command, "row")]
    wakes = [row for _, row in decision.wakes_s]
    if unknown := [row for row in (*rows, *wakes) if row not in live]:
        return f"commands an unknown vehicle, row {unknown[0]}"
    if len(set(rows)) < len(rows):
        return "commands a vehicle twice"
    for wake_s, _ in decision.wakes_s:
        if not wake_s >= view.time_s or wake_s == np.inf:
            return f"asks to be woken at {wake_s} s; allowed is the present or later"
    try:
        hash(decision.memory)
    except TypeError:
        return "has a memory that is not hashable"
    return next(filter(None, map(_wrong_command, decision.commands)), "")


def _wrong_command(command: Any) -> str:
    if isinstance(command, ReleaseToDriver | SetRampSignal):
        return ""
    if isinstance(command, DriveWithAcceleration):
        if not np.isfinite((command.accel_mps2, command.hold_s)).all() or command.hold_s <= 0.0:
            return "commands numbers that are not finite, or a time that is not positive"
        return ""
    if not isinstance(command, FollowTrajectory):
        return f"commands {type(command).__name__}; allowed are those of strategies.base"
    pieces = command.pieces
    if not isinstance(pieces, np.ndarray) or pieces.ndim != 2 or pieces.shape[1] != 4:
        return "commands pieces that are no array of four columns"
    if not 1 <= len(pieces) <= MAX_PIECES:
        return f"commands {len(pieces)} pieces; allowed are 1 to {MAX_PIECES}"
    if (
        pieces.dtype != np.float64
        or not np.isfinite(pieces).all()
        or np.isnan(command.merge_time_s)
    ):
        return "commands numbers that are not finite"
    return ""
