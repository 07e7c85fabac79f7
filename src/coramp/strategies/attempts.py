"""What a strategy tried for a decision, attempt by attempt, and why each of them failed."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, overload

import numpy as np

from coramp._kernel import FloatArray
from coramp.strategies.situation import RUNGS
from coramp.vehicles import trace as t
from coramp.vehicles.fleet import Proposal

CHOSEN = "chosen"
REASONS = {
    t.CHOSEN: CHOSEN,
    t.GAP_TOO_SMALL: "the gap is too small",
    t.AHEAD_OF_REACH: "the gap lies ahead of what the vehicle can reach",
    t.BEHIND_REACH: "the gap lies behind what the vehicle can reach",
    t.HOLDS_UP_NEWCOMER: "a mainline vehicle that is yet to enter would be held up",
    t.FRONT_OUT_OF_REACH: "the front of the gap is out of reach",
    t.PAST_LAST_STATION: "the merge would lie past the last merge station",
    t.BEFORE_THE_NOSE: "the merge would lie before the nose",
    t.SHIFT_TOO_FAR: "a vehicle cannot move so far within its bounds of speed and acceleration",
    t.SHIFT_TOO_FAST: "a vehicle that moves aside would leave the bounds of speed",
    t.SHIFT_TOO_HARD: "a vehicle that moves aside would leave the bounds of acceleration",
    t.TOO_MANY_MOVE: "more vehicles would have to move than one decision may change",
    t.TOO_NEAR: "it comes too near to a vehicle",
    t.NO_LATE_WAY: "no later way to the nose",
    t.FOLLOWERS_CANNOT_BRAKE: "a vehicle behind it on the ramp cannot brake for it",
    t.CANNOT_FALL_BACK: "a vehicle behind it on the mainline cannot fall back for it",
    t.MOVES_MORE: "another gap moves fewer vehicles, or the same by less",
    t.TOO_LATE: "the slot is so late that an earlier one is waited for",
    t.NO_EASY_WAY: "the limits of speed or acceleration allow no way of least effort",
    t.CANNOT_FOLLOW: "it cannot follow the vehicle ahead at a safe distance",
    t.LEADER_WAITS: "a vehicle ahead of it on the ramp has no merge yet",
    t.LEAVES_LANE: "a vehicle that would move is changing lanes",
    t.NOT_ON_MAINLINE: "the vehicle in conflict is still on the ramp",
    t.CHANGE_TOO_LATE: "the vehicle in conflict could not change lanes before the nose is reached",
    t.NO_GAP_FURTHER_IN: "the vehicle in conflict cannot move to a gap further in",
    t.HOLDS_UP_FURTHER_IN: "a vehicle that is yet to enter further in would be held up",
}
"""Why an attempt failed, by the codes of ``vehicles.trace``."""


class Attempt(NamedTuple):
    """One attempt of a decision; rows are -1 and numbers nan where there is none.

    ``reason`` is CHOSEN for the attempt that is carried out, else why it was refused: because
    of ``other_row``, by ``missing_m``. Where a vehicle that moves aside, and not the subject,
    comes too near to it, that is ``moved_row``; so is the vehicle that makes way. The subject
    would pass the nose at ``nose_time_s`` and cruise at ``intercept_m`` + v0 t. The vehicles
    before and behind the gap would move by ``ahead_m`` and ``back_m`` from ``moves_from_s`` on.
    The equations of the merge rest on free movement's acceleration, the lengths of the subject
    and of the vehicle ahead, and the clearance that is planned on either side.
    """

    rung: str
    scenario: int = 0
    front_row: int = -1
    rear_row: int = -1
    reason: str = CHOSEN
    other_row: int = -1
    moved_row: int = -1
    missing_m: float = math.nan
    intercept_m: float = math.nan
    accel_mps2: float = math.nan
    merge_time_s: float = math.nan
    merge_station_m: float = math.nan
    nose_time_s: float = math.nan
    nose_speed_mps: float = math.nan
    ahead_m: float = math.nan
    back_m: float = math.nan
    moves_from_s: float = math.nan
    free_accel_mps2: float = math.nan
    length_m: float = math.nan
    front_length_m: float = math.nan
    clearance_m: float = math.nan


class Tried(Sequence[Attempt]):
    """The attempts of a decision as its kernels wrote them; each is put into words when read.

    Of more attempts than a trace has room for, the first and the last one are kept.
    """

    __slots__ = ("_trace",)

    def __init__(self, trace: FloatArray) -> None:
        self._trace: FloatArray = trace[: int(trace[0, t.COUNT]) + 1].copy()

    def __len__(self) -> int:
        return len(self._trace) - 1

    @property
    def left_out(self) -> int:
        """How many attempts there were before the last one for which there was no room."""
        return int(self._trace[0, t.COUNT]) - len(self)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tried) and self._trace.tobytes() == other._trace.tobytes()

    def __hash__(self) -> int:
        return hash(self._trace.tobytes())

    def __repr__(self) -> str:
        return f"Tried({list(self)!r})"

    @overload
    def __getitem__(self, place: int) -> Attempt: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[Attempt]: ...
    def __getitem__(self, place: int | slice) -> Attempt | Sequence[Attempt]:
        if isinstance(place, slice):
            return [self._attempt(row) for row in self._trace[1:][place]]
        return self._attempt(self._trace[1:][place])

    def __iter__(self) -> Iterator[Attempt]:
        return map(self._attempt, self._trace[1:])

    def _attempt(self, row: FloatArray) -> Attempt:
        return Attempt(
            rung=RUNGS[int(row[t.RUNG])],
            scenario=int(row[t.SCENARIO]),
            front_row=int(row[t.FRONT]),
            rear_row=int(row[t.REAR]),
            reason=REASONS[int(row[t.REASON])],
            other_row=int(row[t.OTHER]),
            moved_row=int(row[t.MOVED]),
            missing_m=float(row[t.MISSING]),
            intercept_m=float(row[t.INTERCEPT]),
            accel_mps2=float(row[t.ACCEL]),
            merge_time_s=float(row[t.MERGE_S]),
            merge_station_m=float(row[t.MERGE_M]),
            nose_time_s=float(row[t.NOSE_S]),
            nose_speed_mps=float(row[t.NOSE_MPS]),
            ahead_m=float(row[t.AHEAD]),
            back_m=float(row[t.BACK]),
            moves_from_s=float(row[t.MOVES_FROM_S]),
            free_accel_mps2=float(self._trace[0, t.FREE_ACCEL]),
            length_m=float(self._trace[0, t.OWN_LENGTH]),
            front_length_m=float(row[t.FRONT_LENGTH]),
            clearance_m=float(self._trace[0, t.CLEARANCE]),
        )


def joined(earlier: Sequence[FloatArray], last: FloatArray) -> FloatArray:
    """Returns the traces of plans that were made one after the other as one, with the last's head.

    The attempt under way is that of the last trace.
    """
    parts = [trace[1 : min(int(trace[0, t.COUNT]), len(trace) - 1) + 1] for trace in earlier]
    rows = np.concatenate([*parts, last[1 : min(int(last[0, t.COUNT]), len(last) - 1) + 1]])
    before = sum(map(len, parts))
    head = last[:1].copy()
    head[0, t.COUNT] = len(rows)
    head[0, t.CURRENT] = last[0, t.CURRENT] + before if last[0, t.COUNT] else len(rows)
    return np.concatenate([head, rows])


def tried_of(proposal: Proposal) -> Tried:
    """Returns what was tried for a proposal."""
    return Tried(proposal.trace)
