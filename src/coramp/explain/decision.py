"""Every intermediate quantity of a decision, with the number of its equation in the paper.

Times count from the decision, stations are those at the decision: what the paper calls time 0.
Everything is computed from the decision's record and the scenario, so that it works as well for a
run of last year as for a plan just made.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from coramp.equations.conflict import in_conflict, mainline_station_at_merge_m, merge_station_m
from coramp.equations.conflict_risk import (
    SEVERITY_THRESHOLD_M2PS4,
    collision_acceleration_of_log_ratio_mps2,
    relative_urgent_acceleration_mps2,
    urgent_acceleration_mps2,
)
from coramp.equations.free_movement import acceleration_time_s
from coramp.equations.gap_creation import (
    acceleration_in_time_mps2,
    distance_driven_m,
    front_station_needed_m,
    half_distance_m,
    half_duration_s,
    merge_station_in_time_m,
    merge_time_from_front_s,
    merge_time_from_rear_s,
    missing_gap_m,
    shift_acceleration_mps2,
    shift_deceleration_mps2,
    speed_at_middle_mps,
    station_at_nose_time_m,
)
from coramp.equations.gaps import (
    acceleration_allowed,
    least_acceleration_mps2,
    merge_station_allowed,
)
from coramp.equations.ramp_acceleration import (
    acceleration_behind_front_mps2,
    acceleration_range_mps2,
    front_balance_m,
    front_station_at_merge_m,
    ramp_station_at_merge_m,
)
from coramp.equations.safe_distance import (
    clock_distance_m,
    merge_clearance_m,
    merge_distance_m,
    merging_speed_along_mps,
    minimum_gap_m,
    minimum_merge_gap_m,
    safe_distance_m,
    speed_difference_distance_m,
)
from coramp.explain.quantity import Quantity
from coramp.road.rules import Rules
from coramp.scenarios.model import Scenario

EVEN_M = 1e-3
"""A merge station this near to that of Eq. 28 is that of Eq. 28."""


@dataclass(frozen=True)
class _Case:
    """A decision in the paper's symbols; stations at time 0, nan for none."""

    rules: Rules
    length_m: float
    t1_s: float
    nose_mps: float
    free_mps2: float
    conflict_m: float
    x_m: float
    y_m: float
    gap_m: float
    accel_mps2: float
    merge_s: float
    shift_m: float
    scenario: int

    @property
    def v0_mps(self) -> float:
        return self.rules.road.mainline_speed_mps

    @property
    def r_m(self) -> float:
        """The station from which the vehicle would reach the nose at its speed there."""
        return -self.nose_mps * self.t1_s


def quantities(decision: Mapping[str, Any], scenario: Scenario) -> list[Quantity]:
    """Returns the quantities behind one row of ``decisions.parquet``, in the paper's order."""
    case = _case_of(decision, scenario)
    lines = [*_distances(case), *_free_movement(case), *_conflict(case)]
    if not math.isnan(case.accel_mps2):
        if decision["rung"] == "delay":
            case = _delayed(case)
        if not _accelerates_evenly(case, decision["merge_station_m"]):
            return _known([*lines, *_least_effort(case, decision["merge_station_m"])])
        if decision["rung"] == "delay":
            lines.append(Quantity("24", "t_1", "time to the nose, delayed", case.t1_s, "s"))
        lines += _acceleration(case)
        if case.scenario:
            lines += _creation(case)
    return _known(lines)


def _known(lines: list[Quantity]) -> list[Quantity]:
    return [line for line in lines if isinstance(line.value, bool) or not math.isnan(line.value)]


def _accelerates_evenly(case: _Case, merge_station_m: float) -> bool:
    """Whether the merge is that of Eq. 28, with one acceleration from the nose on."""
    t2_s = case.merge_s - case.t1_s
    even_m = case.nose_mps * t2_s + 0.5 * case.accel_mps2 * t2_s * t2_s
    return abs(even_m - merge_station_m) < EVEN_M


def _least_effort(case: _Case, merge_station_m: float) -> list[Quantity]:
    """Of a merge whose way is planned as a whole, from the decision on."""
    return [
        Quantity("", "L", "gap between X and Y", case.gap_m, "m"),
        Quantity("36", "dL", "way that X or Y is moved", case.shift_m, "m"),
        Quantity(
            "", "u", "largest acceleration on the way of least effort", case.accel_mps2, "m/s2"
        ),
        Quantity("", "", "merge station", merge_station_m, "m"),
        Quantity("", "", "merge time", case.merge_s, "s"),
    ]


def _case_of(decision: Mapping[str, Any], scenario: Scenario) -> _Case:
    def number(key: str) -> float:
        value = decision[key]
        return math.nan if value is None else float(value)

    rules = scenario.rules()
    now_s = number("time_s")
    nose_mps = number("nose_speed_mps")
    least = least_acceleration_mps2(
        rules.road.mainline_speed_mps, nose_mps, rules.road.last_merge_station_m
    )
    free = min(max(rules.motion.free_acceleration_mps2, least), rules.motion.ramp_acceleration_mps2)
    return _Case(
        rules=rules,
        length_m=number("required_gap_m") - 2.0 * merge_clearance_m(rules.road, rules.safety),
        t1_s=number("nose_time_s") - now_s,
        nose_mps=nose_mps,
        free_mps2=free,
        conflict_m=number("conflict_station_m"),
        x_m=number("front_station_m"),
        y_m=number("rear_station_m"),
        gap_m=number("gap_m"),
        accel_mps2=number("accel_mps2"),
        merge_s=number("merge_time_s") - now_s,
        shift_m=number("largest_shift_m"),
        scenario=int(decision["scenario"] or 0),
    )


def _delayed(case: _Case) -> _Case:
    """The case of a vehicle that comes late: it passes the nose with the ramp's speed."""
    nose_mps = case.rules.road.ramp_speed_mps
    t2_s = acceleration_time_s(case.v0_mps, nose_mps, case.accel_mps2)
    return replace(case, t1_s=case.merge_s - t2_s, nose_mps=nose_mps)


def _distances(case: _Case) -> list[Quantity]:
    v0, safety = case.v0_mps, case.rules.safety
    along = merging_speed_along_mps(v0, case.rules.road.merge_angle_rad)
    at_merge = merge_distance_m(along, v0, safety)
    safe = safe_distance_m(v0, v0, safety)
    return [
        Quantity(
            "2",
            "L_2",
            "clock distance, both at v0",
            clock_distance_m(v0, v0, safety.clock_error_s),
            "m",
        ),
        Quantity(
            "3",
            "L_3",
            "speed distance, v0 behind the ramp's speed",
            speed_difference_distance_m(case.nose_mps, v0, safety.adhesion, safety.resistance),
            "m",
        ),
        Quantity("1", "L_safe", "safe distance, both at v0", safe, "m"),
        Quantity("4", "L_min s", "least gap by Eq. 1", minimum_gap_m(case.length_m, safe), "m"),
        Quantity("", "v_Rx", "speed along the mainline at the merge", along, "m/s"),
        Quantity("15", "L_r-X", "distance to the front vehicle at the merge", at_merge, "m"),
        Quantity("16", "L_r-Y", "distance to the rear vehicle at the merge", at_merge, "m"),
        Quantity(
            "17",
            "L_min s",
            "least gap for the merge",
            minimum_merge_gap_m(case.length_m, at_merge, at_merge),
            "m",
        ),
        Quantity(
            "",
            "",
            "least gap planned: the larger of Eq. 1 and 15 and the allowance, twice",
            case.length_m + 2.0 * merge_clearance_m(case.rules.road, safety),
            "m",
        ),
    ]


def _free_movement(case: _Case) -> list[Quantity]:
    v0 = case.v0_mps
    t2_s = acceleration_time_s(v0, case.nose_mps, case.free_mps2)
    return [
        Quantity("24", "t_1", "time to the nose", case.t1_s, "s"),
        Quantity("", "v_R0", "speed at the nose", case.nose_mps, "m/s"),
        Quantity("25", "t_2", "time on the acceleration lane, free movement", t2_s, "s"),
        Quantity(
            "18",
            "S_R",
            "merge station, free movement",
            merge_station_m(case.nose_mps, v0, case.free_mps2),
            "m",
        ),
    ]


def _conflict(case: _Case) -> list[Quantity]:
    if math.isnan(case.conflict_m):
        return []
    v0, safety = case.v0_mps, case.rules.safety
    merge_s = case.t1_s + acceleration_time_s(v0, case.nose_mps, case.free_mps2)
    own_m = merge_station_m(case.nose_mps, v0, case.free_mps2)
    other_m = mainline_station_at_merge_m(case.conflict_m, v0, merge_s)
    allowance_m = 2.0 * safety.positioning_error_m
    lines = [
        Quantity("19", "S_main", "station of the conflict vehicle then", other_m, "m"),
        Quantity(
            "20", "", "in conflict", bool(in_conflict(own_m, other_m, case.length_m, allowance_m))
        ),
    ]
    distance_m = abs(other_m - own_m) - case.length_m
    return lines + _severity(case, distance_m, "free movement")


def _severity(case: _Case, distance_m: float, when: str) -> list[Quantity]:
    v0 = case.v0_mps
    along = merging_speed_along_mps(v0, case.rules.road.merge_angle_rad)
    collision = collision_acceleration_of_log_ratio_mps2(v0 - along, 0.0)
    printed = urgent_acceleration_mps2(v0, along, distance_m)
    relative = relative_urgent_acceleration_mps2(v0, along, distance_m)
    return [
        Quantity("8", "a", f"collision acceleration, k = 1, {when}", collision, "m/s2"),
        Quantity("9", "a_p", f"urgent acceleration, {when}", printed, "m/s2"),
        Quantity("5", "J", f"severity, {when}", collision * printed, "m2/s4"),
        Quantity("5, 9", "J", f"severity, relative form, {when}", collision * relative, "m2/s4"),
        Quantity(
            "", "J", "threshold (0.3 g)^2, constrains nothing", SEVERITY_THRESHOLD_M2PS4, "m2/s4"
        ),
    ]


def _acceleration(case: _Case) -> list[Quantity]:
    v0, road, motion = case.v0_mps, case.rules.road, case.rules.motion
    most, usable_m = motion.ramp_acceleration_mps2, road.last_merge_station_m
    clearance_m = merge_clearance_m(road, case.rules.safety)
    front_length_m = case.x_m - case.y_m - case.gap_m
    if math.isnan(front_length_m) or math.isinf(case.gap_m):
        front_length_m = case.length_m
    t2_s = case.merge_s - case.t1_s
    at_nose_m = -v0 * case.t1_s
    highest_lag_m = at_nose_m - (case.y_m + case.length_m + clearance_m)
    lowest_lag_m = at_nose_m - (case.x_m - front_length_m - clearance_m)
    low, high = acceleration_range_mps2(
        math.inf if math.isnan(highest_lag_m) else highest_lag_m,
        0.0 if math.isnan(lowest_lag_m) else lowest_lag_m,
        v0,
        case.nose_mps,
        usable_m,
        most,
    )
    allowed = acceleration_allowed(case.accel_mps2, v0, case.nose_mps, usable_m + 1e-6, most + 1e-9)
    return [
        Quantity(
            "21",
            "a_r",
            "least acceleration that reaches v0 in time",
            least_acceleration_mps2(v0, case.nose_mps, usable_m),
            "m/s2",
        ),
        Quantity("22", "a_r", "largest acceleration", most, "m/s2"),
        Quantity("", "L", "gap between X and Y", case.gap_m, "m"),
        Quantity(
            "30",
            "a_r'",
            "acceleration that ends right behind X",
            acceleration_behind_front_mps2(
                case.x_m, case.r_m, v0, case.nose_mps, front_length_m, clearance_m
            )
            if not case.scenario
            else math.nan,
            "m/s2",
        ),
        Quantity("30", "a_r'", "least within the gap", low if low <= high else math.nan, "m/s2"),
        Quantity("30", "a_r'", "largest within the gap", high if low <= high else math.nan, "m/s2"),
        Quantity("31", "a_r'", "acceleration chosen", case.accel_mps2, "m/s2"),
        Quantity("32", "", "within Eq. 22", bool(allowed)),
        Quantity("26", "t_2'", "time on the acceleration lane", t2_s, "s"),
        Quantity(
            "27",
            "S_X",
            "station of X at the merge had it kept v0",
            front_station_at_merge_m(case.x_m, v0, case.t1_s, t2_s),
            "m",
        ),
        Quantity(
            "28",
            "S_R'",
            "merge station",
            ramp_station_at_merge_m(v0, case.nose_mps, case.accel_mps2),
            "m",
        ),
        Quantity(
            "29",
            "",
            "distance to X beyond the least planned, had it kept v0",
            front_balance_m(
                case.x_m,
                case.r_m,
                v0,
                case.nose_mps,
                front_length_m,
                clearance_m,
                case.accel_mps2,
            ),
            "m",
        ),
        Quantity(
            "33",
            "",
            "merge within the acceleration lane",
            bool(
                merge_station_allowed(case.accel_mps2, v0, case.nose_mps, road.acceleration_lane_m)
            ),
        ),
        Quantity("", "t_1 + t_2'", "merge time", case.merge_s, "s"),
    ]


def _creation(case: _Case) -> list[Quantity]:
    v0, nose_mps, control = case.v0_mps, case.nose_mps, case.rules.control
    clearance_m = merge_clearance_m(case.rules.road, case.rules.safety)
    needed_m = case.length_m + 2.0 * clearance_m
    front_length_m = case.x_m - case.y_m - case.gap_m
    if math.isnan(front_length_m):
        front_length_m = case.length_m
    t2_s = case.merge_s - case.t1_s
    window_s = t2_s if control.create_from_nose else case.merge_s - control.actuation_delay_s
    who = {1: "X ahead", 2: "Y back", 3: "X ahead and Y back"}[case.scenario]
    sign = -1.0 if case.scenario == 2 else 1.0
    shift_m = sign * case.shift_m
    merge_m = merge_station_in_time_m(v0, nose_mps, t2_s)
    lines = [
        Quantity("34", "S_X(t_1)", "station of X at t_1", _at_nose(case, case.x_m), "m"),
        Quantity("35", "S_Y(t_1)", "station of Y at t_1", _at_nose(case, case.y_m), "m"),
        Quantity("36", "dL", "missing gap", missing_gap_m(needed_m, case.gap_m), "m"),
        Quantity("", "", f"scenario {case.scenario}: {who}; largest shift", shift_m, "m"),
    ]
    if case.scenario == 1:
        lines += [
            Quantity(
                "34, 38, 39",
                "t_2'",
                "right behind X once it has moved",
                merge_time_from_front_s(
                    case.x_m, case.t1_s, v0, nose_mps, front_length_m, clearance_m, shift_m
                ),
                "s",
            ),
            Quantity(
                "34, 38, 39",
                "t_2'",
                "right before Y",
                merge_time_from_rear_s(
                    case.y_m, case.t1_s, v0, nose_mps, case.length_m, clearance_m
                ),
                "s",
            ),
            Quantity(
                "39",
                "S_X",
                "station that X needs at t_1 to make the gap from there",
                front_station_needed_m(merge_m, front_length_m, clearance_m, v0, t2_s, shift_m),
                "m",
            ),
        ]
    accel = shift_acceleration_mps2(shift_m, window_s)
    return [
        *lines,
        Quantity(
            "37",
            "a_r'",
            "acceleration of the ramp vehicle",
            acceleration_in_time_mps2(v0, nose_mps, t2_s),
            "m/s2",
        ),
        Quantity("38", "S_mr'", "merge station", merge_m, "m"),
        Quantity("", "T", "time for the shift", window_s, "s"),
        Quantity(
            "40", "S_X", "way driven in that time", distance_driven_m(v0, window_s, shift_m), "m"
        ),
        Quantity("41", "S_X / 2", "half of it", half_distance_m(v0, window_s, accel), "m"),
        Quantity("42", "a_acc", "first half", accel, "m/s2"),
        Quantity("43", "a_dec", "second half", shift_deceleration_mps2(shift_m, window_s), "m/s2"),
        Quantity("44", "t_acc", "half of the time", half_duration_s(window_s), "s"),
        Quantity("45", "v_t", "speed half-way", speed_at_middle_mps(v0, shift_m, window_s), "m/s"),
    ]


def _at_nose(case: _Case, station_m: float) -> float:
    return station_at_nose_time_m(station_m, case.v0_mps, case.r_m, case.nose_mps)
