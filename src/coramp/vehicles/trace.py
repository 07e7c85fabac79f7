"""What a planner tried for one decision, as an array that its kernels write while they try.

One row is one attempt; row 0 tells how many there are and what holds for all of them. A kernel that
gives up says why in the row of the attempt that is under way. Nothing reads the rows while a plan
is made, so they change no plan.
"""

import math

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel

(
    RUNG,
    SCENARIO,
    FRONT,
    REAR,
    FRONT_LENGTH,
    REASON,
    OTHER,
    MOVED,
    MISSING,
    INTERCEPT,
    ACCEL,
    MERGE_S,
    MERGE_M,
    NOSE_S,
    NOSE_MPS,
    AHEAD,
    BACK,
    MOVES_FROM_S,
    COLUMNS,
) = range(19)
"""Columns of an attempt, and how many there are. Rows of vehicles are -1, numbers nan for none.

REASON is one of those below. OTHER is the vehicle that is in the way or cannot do its part, MOVED
one that would be moved, where that and not the subject comes too near to OTHER, or the one that
makes way. MISSING is by how much (m) it fails. INTERCEPT is station - v0 t (m) once the subject
cruises. AHEAD and BACK are by how much (m) the vehicles before and behind the gap move for it, from
MOVES_FROM_S on.
"""
COUNT, CURRENT, FREE_ACCEL, OWN_LENGTH, CLEARANCE = range(5)
"""Columns of row 0: how many attempts there were, the row of the one under way, and what holds for
all of them: free movement's acceleration (m/s2), the subject's length and the clearance planned (m)
to either side."""
ROOM = 512
"""Attempts for which there is room, and row 0; the last row is always the latest attempt."""

(
    CHOSEN,
    GAP_TOO_SMALL,
    AHEAD_OF_REACH,
    BEHIND_REACH,
    HOLDS_UP_NEWCOMER,
    FRONT_OUT_OF_REACH,
    PAST_LAST_STATION,
    BEFORE_THE_NOSE,
    SHIFT_TOO_FAR,
    SHIFT_TOO_FAST,
    SHIFT_TOO_HARD,
    TOO_MANY_MOVE,
    TOO_NEAR,
    NO_LATE_WAY,
    FOLLOWERS_CANNOT_BRAKE,
    CANNOT_FALL_BACK,
    MOVES_MORE,
    TOO_LATE,
    NO_EASY_WAY,
    CANNOT_FOLLOW,
    LEADER_WAITS,
    LEAVES_LANE,
    NOT_ON_MAINLINE,
    CHANGE_TOO_LATE,
    HOLDS_UP_FURTHER_IN,
    NO_GAP_FURTHER_IN,
) = range(26)
"""Why an attempt failed; CHOSEN is the one that did not."""


@kernel
def empty_trace() -> FloatArray:
    """Returns a trace of no attempt."""
    trace = np.empty((ROOM, COLUMNS))
    trace[0, :] = math.nan
    trace[0, COUNT] = trace[0, CURRENT] = 0.0
    return trace


@kernel
def open_attempt(trace: FloatArray, rung: int, scenario: int, front: int, rear: int) -> None:
    """Begins an attempt between two vehicles (-1 for none); until it is refused it is chosen."""
    count = trace[0, COUNT] + 1.0
    current = min(int(count), len(trace) - 1)
    trace[0, COUNT], trace[0, CURRENT] = count, current
    row = trace[current]
    row[:] = math.nan
    row[RUNG], row[SCENARIO], row[FRONT], row[REAR] = rung, scenario, front, rear
    row[REASON], row[OTHER], row[MOVED] = CHOSEN, -1.0, -1.0


@kernel
def open_in_gap(trace: FloatArray, rung: int, scenario: int, order: IntArray, gap: int) -> None:
    """Begins an attempt in gap ``gap`` of a lane order."""
    front = order[gap - 1] if gap > 0 else -1
    rear = order[gap] if gap < len(order) else -1
    open_attempt(trace, rung, scenario, front, rear)


@kernel
def refuse(trace: FloatArray, reason: int, other: int, missing_m: float) -> None:
    """Says why the attempt under way fails, because of which vehicle (-1), by how much (m)."""
    row = trace[int(trace[0, CURRENT])]
    row[REASON], row[OTHER], row[MOVED], row[MISSING] = reason, other, -1.0, missing_m


@kernel
def accept(trace: FloatArray) -> None:
    """Takes back why the attempt under way failed, after another way of it has helped."""
    refuse(trace, CHOSEN, -1, math.nan)


@kernel
def refuse_as_too_near(trace: FloatArray, moved: int, other: int, missing_m: float) -> None:
    """Says that the subject, or a vehicle that is moved (else -1), comes too near to another."""
    refuse(trace, TOO_NEAR, other, missing_m)
    trace[int(trace[0, CURRENT]), MOVED] = moved


@kernel
def note_moved(trace: FloatArray, moved: int) -> None:
    """Says who makes way for the attempt under way."""
    trace[int(trace[0, CURRENT]), MOVED] = moved


@kernel
def note_gap(trace: FloatArray, front: int, rear: int) -> None:
    """Says between which vehicles (-1 for none) the attempt under way turns out to be."""
    row = trace[int(trace[0, CURRENT])]
    row[FRONT], row[REAR] = front, rear


@kernel
def note_merge(
    trace: FloatArray,
    intercept_m: float,
    accel_mps2: float,
    merge_s: float,
    merge_m: float,
    nose_s: float,
    nose_mps: float,
) -> None:
    """Says where the attempt under way would pass the nose and merge."""
    row = trace[int(trace[0, CURRENT])]
    row[INTERCEPT], row[ACCEL], row[MERGE_S], row[MERGE_M] = (
        intercept_m,
        accel_mps2,
        merge_s,
        merge_m,
    )
    row[NOSE_S], row[NOSE_MPS] = nose_s, nose_mps


@kernel
def note_moves(trace: FloatArray, ahead_m: float, back_m: float, from_s: float) -> None:
    """Says by how much (m) X and Y move for the attempt under way, and from when on (s)."""
    row = trace[int(trace[0, CURRENT])]
    row[AHEAD], row[BACK], row[MOVES_FROM_S] = ahead_m, back_m, from_s


@kernel
def note_subject(
    trace: FloatArray, free_mps2: float, own_length_m: float, clearance_m: float
) -> None:
    """Says what holds for every attempt of the decision."""
    head = trace[0]
    head[FREE_ACCEL], head[OWN_LENGTH], head[CLEARANCE] = free_mps2, own_length_m, clearance_m


@kernel
def note_choice(trace: FloatArray, rung: int, scenario: int, front_length_m: float) -> None:
    """Says as what the attempt under way is carried out, with the length (m) of the vehicle ahead.

    That is nan where there is none.
    """
    row = trace[int(trace[0, CURRENT])]
    row[RUNG], row[SCENARIO], row[FRONT_LENGTH] = rung, scenario, front_length_m


@kernel
def give_preference(trace: FloatArray, before: int) -> int:
    """Prefers the attempt under way to an earlier one (its row, 0 for none); returns its row."""
    current = int(trace[0, CURRENT])
    if before > 0:
        trace[0, CURRENT] = before
        refuse(trace, MOVES_MORE, -1, math.nan)
        trace[0, CURRENT] = current
    return current
