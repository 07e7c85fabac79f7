"""Holds a strategy that is not coramp's own to the interface: what it may answer, and how long."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol, cast

import numpy as np

from coramp.coordination.time_limit import TooLong, time_limit
from coramp.errors import CorampError, printable
from coramp.kinematics.trajectory import MAX_PIECES
from coramp.strategies.attempts import Attempt
from coramp.strategies.base import (
    Decider,
    Decision,
    DriveWithAcceleration,
    Explanation,
    FollowTrajectory,
    Memory,
    ReleaseToDriver,
    SetRampSignal,
    View,
    entry_policy_of,
    is_metered,
    period_of,
)
from coramp.strategies.registry import OURS, origin_of, strategy_named
from coramp.strategies.situation import RUNGS
from coramp.vehicles.fleet import MAX_CHANGED, Fleet

LONGEST_DECISION_S = 10.0
"""Wall time after which a decision counts as one that never comes; compiling does not count."""
SHORTEST_PERIOD_S, LONGEST_PERIOD_S = 0.01, 3600.0
MOST_AT_ONCE = 10_000
"""So many decisions at one time are a strategy that wakes itself without end."""


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
        self._cooperative = bool(getattr(strategy, "cooperative", True))
        self.entry_policy = entry_policy_of(strategy)
        self._strategy = strategy
        self._longest_s = longest_s
        self._time_s = -1.0
        self._at_once = 0

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns what the strategy decides; raises CorampError where that cannot be used."""
        self._at_once = self._at_once + 1 if view.time_s == self._time_s else 0
        self._time_s = view.time_s
        decision, problem = self._asked(shown := _copied(view), memory)
        problem = problem or _written_into(shown, view) or _wrong_with(decision, view)
        problem = problem or self._for_drivers(decision)
        if self._at_once > MOST_AT_ONCE:
            problem = "wakes itself without end"
        if problem or decision is None:
            raise CorampError(f"strategy {self.name}: at {view.time_s:.1f} s it {problem}")
        return decision

    def _for_drivers(self, decision: Decision | None) -> str:
        """Says which command nobody would carry out where all vehicles are cooperative."""
        if not self._cooperative or decision is None:
            return ""
        for command in decision.commands:
            if isinstance(command, ReleaseToDriver | SetRampSignal):
                what = type(command).__name__
                return f"commands {what}; allowed is that where cooperative is False"
        return ""

    def _asked(self, view: View, memory: Memory) -> tuple[Decision | None, str]:
        try:
            with time_limit(self._longest_s):
                return self._strategy.decide(view, memory), ""
        except TooLong:
            return None, f"takes longer than {self._longest_s:g} s to decide"
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # noqa: BLE001 - it may raise anything, or exit
            return None, _told(error)


def _copied(view: View) -> View:
    """Returns the view with arrays of its own: what is written into them reaches nobody."""
    fleet = Fleet._make(array.copy() for array in view.fleet)
    same = view.acknowledged is view.fleet
    acknowledged = fleet if same else Fleet._make(a.copy() for a in view.acknowledged)
    packed_rules = view.packed_rules.copy()
    return replace(view, fleet=fleet, acknowledged=acknowledged, packed_rules=packed_rules)


def _written_into(shown: View, view: View) -> str:
    """Says into which part of a view the strategy has written, or nothing."""
    for name in ("fleet", "acknowledged"):
        pairs = zip(getattr(shown, name), getattr(view, name), strict=True)
        if not all(np.array_equal(mine, given, equal_nan=True) for mine, given in pairs):
            return f"writes into view.{name}; allowed is to read it"
    if not np.array_equal(shown.packed_rules, view.packed_rules):
        return "writes into view.packed_rules; allowed is to read it"
    return ""


def strategy_to_run(name: str, settings: Mapping[str, Any] | None = None) -> Decider:
    """Returns a strategy by name, with its parameters, guarded unless it is coramp's own.

    Raises CorampError if there is none such, or it cannot be made.
    """
    chosen: Any = strategy_named(name)
    if origin_of(name) == OURS:
        return cast("Decider", chosen(**(settings or {})))
    try:
        with time_limit(LONGEST_DECISION_S):
            return Guarded(chosen(**(settings or {})))
    except (CorampError, KeyboardInterrupt):
        raise
    except TooLong:
        problem = f"takes longer than {LONGEST_DECISION_S:g} s to be made"
    except BaseException as error:  # noqa: BLE001 - it may raise anything, or exit
        problem = _told(error)
    raise CorampError(f"strategy {name}: {problem}")


def _told(error: BaseException) -> str:
    text = printable(str(error))
    return f"raises {type(error).__name__}: {text}" if text else f"raises {type(error).__name__}"


def _period_checked(strategy: Guardable) -> float | None:
    period_s: Any = period_of(strategy)
    if period_s is None and is_metered(strategy):
        raise CorampError(
            f"strategy {strategy.name}: period_s: is missing, and it sets a signal; allowed is a "
            f"number from {SHORTEST_PERIOD_S:g} to {LONGEST_PERIOD_S:g}"
        )
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
    try:
        return _wrong_inside(decision, view)
    except (TypeError, ValueError, AttributeError) as error:
        return f"returns what is no decision: {error}"


def _wrong_inside(decision: Decision, view: View) -> str:
    live = {*view.fleet.live.tolist(), *view.fleet.inner.tolist()}
    moved = [command for command in decision.commands if isinstance(command, FollowTrajectory)]
    if len(moved) > MAX_CHANGED:
        return f"commands {len(moved)} trajectories; allowed are {MAX_CHANGED} at a time"
    rows = [command.row for command in decision.commands if hasattr(command, "row")]
    to_drivers = [row for row in rows if _is_row(row) and row < -1]
    if to_drivers:  # refused and counted by the loop
        live.update(view.drivers.rows.tolist())
    named = [*rows, *(row for _, row in decision.wakes_s)]
    named += [explanation.row for explanation in decision.explanations]
    for explanation in decision.explanations:
        for attempt in explanation.tried:
            named += [row for row in _rows_of(attempt) if row != -1]
    if unknown := [row for row in named if not _is_row(row) or row not in live]:
        return f"commands an unknown vehicle, row {unknown[0]}"
    if len(set(rows)) < len(rows):
        return "commands a vehicle twice"
    for wake_s, _ in decision.wakes_s:
        if not view.time_s <= wake_s < np.inf:
            return f"asks to be woken at {wake_s} s; allowed is the present or later"
    try:
        hash(decision.memory)
    except TypeError:
        return "has a memory that is not hashable"
    problems = (*map(_wrong_command, decision.commands), *map(_wrong_story, decision.explanations))
    return next(filter(None, problems), "")


def _is_row(row: Any) -> bool:
    return isinstance(row, int | np.integer) and not isinstance(row, bool)


def _wrong_story(explanation: Explanation) -> str:
    if explanation.rung not in RUNGS:
        return f"explains itself by rung {explanation.rung!r}; allowed are {', '.join(RUNGS)}"
    rest = (explanation.conflict_row, explanation.front_row, explanation.rear_row)
    if not all(map(_is_row, rest)):
        return "explains itself by rows that are no whole numbers"
    sum(map(float, explanation[2:-1]))  # raises for what is no number
    return next(filter(None, map(_wrong_attempt, explanation.tried)), "")


def _rows_of(attempt: Attempt) -> tuple[int, int, int, int]:
    return attempt.front_row, attempt.rear_row, attempt.other_row, attempt.moved_row


def _wrong_attempt(attempt: Attempt) -> str:
    if not isinstance(attempt, Attempt) or not isinstance(attempt.reason, str):
        return f"tells {attempt!r} of what it tried; allowed are Attempts of strategies.attempts"
    if attempt.rung not in RUNGS:
        return f"tells of an attempt by rung {attempt.rung!r}; allowed are {', '.join(RUNGS)}"
    sum(map(float, (attempt.scenario, *attempt[7:])))  # raises for what is no number
    return ""


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
