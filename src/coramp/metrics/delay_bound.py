"""The least mean delay that one lane allows, as a queue with one server.

Whoever leaves the zone does so ``h`` after the vehicle before it or later, and not before it would
with nobody in its way. In the order of these earliest exits e, Lindley's recursion

    c_i = max(e_i, c_(i-1) + h)

gives the least sum of exit times: the k-th vehicle to leave, in whatever order, leaves at the
largest of ``e_j + (k - j) h`` over j <= k or later, which is c_k. For equal h every order in which
the lane never idles has this sum; the streams' shares in it depend on the order.
"""

from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, kernel
from coramp.equations.gaps import least_acceleration_mps2
from coramp.equations.safe_distance import following_clearance_m
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    clip_end,
    drive_to_speed,
    time_at_station,
)
from coramp.motion.approach import harmonise
from coramp.road.rules import Rules, unpacked

SECONDS_PER_HOUR = 3600.0
NOTHING_SAVED = np.zeros(1)


class Arrived(NamedTuple):
    """Who comes when: one entry a vehicle. ``free_flow_s`` is what delay is counted beyond."""

    scheduled_s: FloatArray
    on_ramp: BoolArray
    entry_speed_mps: FloatArray
    free_flow_s: FloatArray


class MeanDelays(NamedTuple):
    """Mean delays (s) of all vehicles and of each stream, nan for none.

    Of the recursion's only that of all is a bound.
    """

    all_s: float
    mainline_s: float
    ramp_s: float


def lane_headway_s(shortest_m: float, rules: Rules) -> float:
    """Returns h = (L + clearance) / v0 in s, of vehicles of the shortest length present.

    The clearance is what is planned behind any vehicle at v0, Eq. 1 and the allowance: with it
    h = time_gap + (L + 2 L_1 + clock distance + standstill gap + allowance) / v0. The merge itself
    may ask for more (Eq. 15), but vehicles may close up after it.
    """
    occupied_m = shortest_m + following_clearance_m(rules.road, rules.safety)
    return occupied_m / rules.road.mainline_speed_mps


def lane_limit_veh_h(headway_s: float) -> float:
    """Returns 3600 / h, how many vehicles of both streams a lane carries (veh/h)."""
    return SECONDS_PER_HOUR / headway_s


@kernel
def earliest_exits_s(
    scheduled_s: FloatArray,
    on_ramp: BoolArray,
    entry_speed_mps: FloatArray,
    packed_rules: FloatArray,
) -> FloatArray:
    """Returns when each vehicle would leave the zone (s) if it entered on time and alone.

    That is its entry's own plan: harmonised at once to v0, or on the ramp to v_R0 and from the nose
    on to v0 by free movement (the free acceleration within Eq. 22).
    """
    rules = unpacked(packed_rules)
    road, motion = rules.road, rules.motion
    v0, most = road.mainline_speed_mps, motion.ramp_acceleration_mps2
    out = np.empty((MAX_PIECES, 4))
    exit_s = np.empty(len(scheduled_s))
    for i in range(len(scheduled_s)):
        n = harmonise(
            out,
            scheduled_s[i],
            road.ramp_start_m if on_ramp[i] else road.mainline_start_m,
            entry_speed_mps[i],
            rules.control.actuation_delay_s,
            0.0,
            road.ramp_speed_mps if on_ramp[i] else v0,
            motion,
        )
        if on_ramp[i]:
            n = clip_end(out, n, time_at_station(out[:n], 0.0))
            least = least_acceleration_mps2(v0, out[n - 1, SPEED], road.last_merge_station_m)
            accel_mps2 = min(max(motion.free_acceleration_mps2, least), most)
            n = drive_to_speed(out, n, accel_mps2, v0)
        exit_s[i] = time_at_station(out[:n], road.mainline_end_m)
    return exit_s


def first_come_exits_s(
    earliest_s: FloatArray, headway_s: float, saved_s: FloatArray = NOTHING_SAVED
) -> FloatArray:
    """Returns each vehicle's exit (s) where the first to come is the first to leave.

    ``saved_s[n]`` is by how much n headways together may at most be shorter than n h; what lies
    beyond its end saves as much as its last entry.
    """
    # numba would compile a kernel with an array as a default anew in each process
    return _first_come_exits_s(earliest_s, headway_s, saved_s)


@kernel
def _first_come_exits_s(
    earliest_s: FloatArray, headway_s: float, saved_s: FloatArray
) -> FloatArray:
    exit_s = np.empty(len(earliest_s))
    last_s, behind = -np.inf, 0
    for i in np.argsort(earliest_s, kind="mergesort"):
        behind = behind + 1 if last_s + headway_s > earliest_s[i] else 0
        last_s = max(earliest_s[i], last_s + headway_s)
        exit_s[i] = max(earliest_s[i], last_s - saved_s[min(behind, len(saved_s) - 1)])
    return exit_s


def quickest_exits_s(earliest_s: FloatArray, exit_s: FloatArray) -> FloatArray:
    """Returns earliest exits that a run kept: its own (nan: never) where a plan was quicker."""
    return np.fmin(earliest_s, exit_s)


def saved_s(headway_s: float, exit_s: FloatArray) -> FloatArray:
    """Returns by how much n headways of a run were at most shorter than n h (s), for n = 0, 1, ..

    ``exit_s`` are the run's exits, nan for never. Zeros but where vehicles left below v0.
    """
    short_s = headway_s - np.diff(np.sort(exit_s[~np.isnan(exit_s)]))
    longest_first_s = np.sort(short_s[short_s > 0.0])[::-1]
    return np.concatenate([NOTHING_SAVED, np.cumsum(longest_first_s)])


def mean_delays(arrived: Arrived, exit_s: FloatArray) -> MeanDelays:
    """Returns the mean delays of vehicles that leave then."""
    delay_s = exit_s - arrived.scheduled_s - arrived.free_flow_s
    return MeanDelays(
        _mean_s(delay_s), _mean_s(delay_s[~arrived.on_ramp]), _mean_s(delay_s[arrived.on_ramp])
    )


def _mean_s(delay_s: FloatArray) -> float:
    return float(np.mean(delay_s)) if len(delay_s) else float("nan")
