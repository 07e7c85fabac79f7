"""What a ramp vehicle finds at its decision: its way to the nose, the lane order, the conflict."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.equations.conflict import conflict_index
from coramp.equations.gaps import least_acceleration_mps2
from coramp.equations.ramp_acceleration import lag_m
from coramp.equations.safe_distance import merge_clearance_m
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    TIME,
    cruise_intercept_m,
    station_and_speed,
)
from coramp.motion.approach import approach_without_stop
from coramp.road.rules import Rules
from coramp.strategies.ramp_queue import next_behind_on_ramp
from coramp.vehicles.fleet import Fleet, committed, leaves_lane_s
from coramp.vehicles.merge_state import has_place_on_mainline, is_waiting

RUNG_FREE, RUNG_REACH, RUNG_CREATE, RUNG_DELAY, RUNG_HOLD, RUNG_MAKE_WAY = range(6)
RUNGS = ("free", "reach", "create", "delay", "hold", "make way")
RUNGS_OF_ONE_LANE = RUNGS[:RUNG_MAKE_WAY]
"""Those with a column of their own, ``rung_*``; ``made_way`` counts the last one."""


class Situation(NamedTuple):
    """The subject of a decision and what it may do.

    An intercept is a vehicle's station less v0 times time once it cruises: vehicles that cruise at
    v0 keep theirs, and their differences are their distances. ``order`` lists the rows that are or
    will be on the mainline, front first; ``intercepts_m`` are theirs. ``lowest_m`` to ``highest_m``
    are the intercepts that the subject reaches with the accelerations of Eq. 22, ``free_m`` that
    of its free movement. ``known_m`` bounds what is
    known: no vehicle yet to enter can come to an intercept ahead of it. The subject must not take a
    merge that would hold such a vehicle up.
    """

    subject: int
    from_s: float
    approach: FloatArray
    nose_s: float
    nose_speed_mps: float
    free_accel_mps2: float
    lowest_m: float
    highest_m: float
    free_m: float
    known_m: float
    clearance_m: float
    order: IntArray
    intercepts_m: FloatArray


class MergePlan(NamedTuple):
    """The outcome of a decision; rows are -1 and numbers nan where there is none.

    Severities (m2/s4) are those between the subject and its conflict vehicle at the merge, of free
    movement and as planned, with Eq. 9 as printed and in its relative form.
    """

    rung: int
    scenario: int
    conflict_row: int
    front_row: int
    rear_row: int
    gap_m: float
    required_gap_m: float
    accel_mps2: float
    merge_time_s: float
    merge_station_m: float
    largest_shift_m: float
    severity_before: float
    severity_after: float
    relative_severity_before: float
    relative_severity_after: float
    nose_time_s: float
    nose_speed_mps: float
    conflict_station_m: float
    front_station_m: float
    rear_station_m: float


@kernel
def ramp_neighbours(fleet: Fleet, subject: int, from_s: float) -> tuple[bool, int]:
    """Returns whether a vehicle ahead on the ramp has no committed merge yet, and who is behind.

    The latter is the next row without a committed merge, or -1.
    """
    own_m, _ = station_and_speed(committed(fleet, subject), from_s)
    blocked = False
    for row in fleet.live:
        if row != subject and is_waiting(fleet.merge_time_s[row]):
            other_m, _ = station_and_speed(committed(fleet, row), from_s)
            blocked = blocked or other_m > own_m
    return blocked, next_behind_on_ramp(fleet, subject, from_s)


@kernel
def lane_order(
    fleet: Fleet, subject: int, v0_mps: float, from_s: float = -math.inf
) -> tuple[IntArray, FloatArray]:
    """Returns the rows that are or will be on the mainline, front first, and their intercepts.

    Who has left its lane by ``from_s`` for one further in is not among them.
    """
    rows = np.empty(len(fleet.live), np.int64)
    intercepts_m = np.empty(len(fleet.live))
    n = 0
    for row in fleet.live:
        stays = leaves_lane_s(fleet, row) > from_s
        if row != subject and has_place_on_mainline(fleet.merge_time_s[row]) and stays:
            value_m = cruise_intercept_m(committed(fleet, row), v0_mps)
            k = n
            while k > 0 and intercepts_m[k - 1] < value_m:
                intercepts_m[k], rows[k] = intercepts_m[k - 1], rows[k - 1]
                k -= 1
            intercepts_m[k], rows[k] = value_m, row
            n += 1
    return rows[:n], intercepts_m[:n]


@kernel
def foremost_unknown_m(now_s: float, fastest_entry_mps: float, rules: Rules) -> float:
    """Returns the foremost intercept (m) of a mainline vehicle that has not entered by ``now_s``.

    It enters at the zone's start, at v0 or, if faster, gains what slowing down to v0 takes.
    """
    v0 = rules.road.mainline_speed_mps
    excess_mps = max(0.0, fastest_entry_mps - v0)
    gain_m = excess_mps * (
        rules.control.actuation_delay_s + 0.5 * excess_mps / rules.motion.slow_down_mps2
    )
    return rules.road.mainline_start_m + gain_m - v0 * now_s


@kernel
def assess(
    fleet: Fleet,
    subject: int,
    now_s: float,
    fastest_entry_mps: float,
    rules: Rules,
) -> Situation:
    """Returns the situation of ``subject`` at ``now_s``."""
    road, motion, control = rules.road, rules.motion, rules.control
    from_s = now_s + control.actuation_delay_s
    buffer = np.empty((MAX_PIECES, 4))
    n = approach_without_stop(committed(fleet, subject), from_s, road, motion, buffer)
    v0, nose_s = road.mainline_speed_mps, buffer[n - 1, TIME]
    order, intercepts_m = lane_order(fleet, subject, v0, nose_s)
    return situation_from(
        subject,
        from_s,
        buffer[:n],
        foremost_unknown_m(now_s, fastest_entry_mps, rules),
        order,
        intercepts_m,
        rules,
    )


@kernel
def situation_from(
    subject: int,
    from_s: float,
    approach: FloatArray,
    known_m: float,
    order: IntArray,
    intercepts_m: FloatArray,
    rules: Rules,
) -> Situation:
    """Returns the situation of a subject that comes to the nose by ``approach``."""
    road, motion = rules.road, rules.motion
    v0 = road.mainline_speed_mps
    last = len(approach) - 1
    nose_s, nose_speed_mps = approach[last, TIME], approach[last, SPEED]
    least = least_acceleration_mps2(v0, nose_speed_mps, road.last_merge_station_m)
    most = motion.ramp_acceleration_mps2
    free = min(max(motion.free_acceleration_mps2, least), most)
    at_nose_m = -v0 * nose_s
    return Situation(
        subject,
        from_s,
        approach,
        nose_s,
        nose_speed_mps,
        free,
        at_nose_m - lag_m(v0, nose_speed_mps, least),
        at_nose_m - lag_m(v0, nose_speed_mps, most),
        at_nose_m - lag_m(v0, nose_speed_mps, free),
        known_m,
        merge_clearance_m(road, rules.safety),
        order,
        intercepts_m,
    )


@kernel
def gap_of_free_movement(situation: Situation) -> int:
    """Returns k such that free movement ends between ``order[k - 1]`` and ``order[k]``."""
    k = 0
    while k < len(situation.order) and situation.intercepts_m[k] > situation.free_m:
        k += 1
    return k


@kernel
def conflict_position(fleet: Fleet, situation: Situation, rules: Rules) -> int:
    """Returns the position in ``order`` of the conflict vehicle, -1 on an empty mainline.

    The vehicle of Eq. 20 at the merge of free movement; where none fulfils it, the one nearest to
    the subject, which may still be too near for Eq. 15, 16.
    """
    count = len(situation.order)
    if count == 0:
        return -1
    v0 = rules.road.mainline_speed_mps
    merge_s = situation.nose_s + (v0 - situation.nose_speed_mps) / situation.free_accel_mps2
    merge_m = situation.free_m + v0 * merge_s
    stations_m = np.empty(count)
    nearest = 0
    for k in range(count):
        stations_m[k], _ = station_and_speed(committed(fleet, situation.order[k]), merge_s)
        if abs(stations_m[k] - merge_m) < abs(stations_m[nearest] - merge_m):
            nearest = k
    found = conflict_index(
        merge_m,
        stations_m,
        fleet.length_m[situation.subject],
        2.0 * rules.safety.positioning_error_m,
    )
    return found if found >= 0 else nearest


@kernel
def gap_bounds_m(fleet: Fleet, situation: Situation, k: int) -> tuple[float, float]:
    """Returns the lowest and highest intercept (m) at which the subject fits into gap ``k``.

    Gap k lies between ``order[k - 1]`` and ``order[k]``; the first has no front vehicle, the last
    no rear one. The lowest exceeds the highest where the gap is too small. Nowhere may the merge
    hold up a vehicle that is yet to enter.
    """
    own_m = fleet.length_m[situation.subject] + situation.clearance_m
    return bounds_between_m(
        situation.order,
        situation.intercepts_m,
        fleet.length_m,
        k,
        situation.known_m,
        own_m,
        situation.clearance_m,
    )


@kernel
def bounds_between_m(
    order: IntArray,
    intercepts_m: FloatArray,
    length_m: FloatArray,
    k: int,
    known_m: float,
    own_m: float,
    clearance_m: float,
) -> tuple[float, float]:
    """Returns the bounds of ``gap_bounds_m``; ``own_m`` is the subject's length and clearance.

    For loops over many gaps: handing whole tuples of arrays to a kernel costs more than it does.
    """
    low_m = known_m
    high_m = math.inf
    if k < len(order):
        low_m = max(low_m, intercepts_m[k])
    if k > 0:
        high_m = intercepts_m[k - 1] - length_m[order[k - 1]] - clearance_m
    return low_m + own_m, high_m


@kernel
def gaps_by_preference(fleet: Fleet, situation: Situation, conflict: int) -> IntArray:
    """Returns gap numbers: before the conflict vehicle, behind it, then by distance.

    The distance is that from free movement to where the subject would fit, whether or not the gap
    is large enough.
    """
    order, intercepts_m, length_m = situation.order, situation.intercepts_m, fleet.length_m
    free_m, known_m, clearance_m = situation.free_m, situation.known_m, situation.clearance_m
    own_m = length_m[situation.subject] + clearance_m
    distances_m = np.empty(len(order) + 1)
    for k in range(len(distances_m)):
        low_m, high_m = bounds_between_m(
            order, intercepts_m, length_m, k, known_m, own_m, clearance_m
        )
        if low_m > high_m:
            low_m = high_m = 0.5 * (low_m + high_m)
        distances_m[k] = max(0.0, low_m - free_m, free_m - high_m)
    if conflict >= 0:
        distances_m[conflict] = -2.0
        distances_m[conflict + 1] = -1.0
    return ascending_order(distances_m)


@kernel
def ascending_order(values: FloatArray) -> IntArray:
    """Returns the places of ``values``, smallest first, equal ones as they stand.

    By insertion, which is quick for the few dozen vehicles of a zone.
    """
    places = np.empty(len(values), np.int64)
    for n in range(len(values)):
        k = n
        while k > 0 and values[places[k - 1]] > values[n]:
            places[k] = places[k - 1]
            k -= 1
        places[k] = n
    return places


@kernel
def gap_size_m(fleet: Fleet, situation: Situation, k: int) -> float:
    """Returns the bumper distance (m) between the vehicles of gap ``k``.

    Infinity at an open end, nan for the gap -1 of a plan without one.
    """
    if k < 0:
        return math.nan
    if k == 0 or k == len(situation.order):
        return math.inf
    front = situation.order[k - 1]
    return float(situation.intercepts_m[k - 1] - fleet.length_m[front] - situation.intercepts_m[k])
