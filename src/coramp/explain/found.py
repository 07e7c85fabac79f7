"""What a decision found: the distances to keep, free movement, and the conflict that it meets."""

import math

from coramp.equations.conflict import in_conflict, mainline_station_at_merge_m, merge_station_m
from coramp.equations.conflict_risk import (
    SEVERITY_THRESHOLD_M2PS4,
    collision_acceleration_of_log_ratio_mps2,
)
from coramp.equations.free_movement import acceleration_time_s
from coramp.equations.safe_distance import (
    clock_distance_m,
    merge_distance_m,
    merging_speed_along_mps,
    minimum_gap_m,
    minimum_merge_gap_m,
    safe_distance_m,
    speed_difference_distance_m,
)
from coramp.explain.case import Case
from coramp.explain.quantity import Quantity


def distances(case: Case) -> list[Quantity]:
    """Returns the distances that the paper asks for at v0, and the gap that was asked for."""
    v0, safety, own_m = case.v0_mps, case.rules.safety, case.length_m
    along = merging_speed_along_mps(v0, case.rules.road.merge_angle_rad)
    at_merge = merge_distance_m(along, v0, safety)
    safe = safe_distance_m(v0, v0, safety)
    clock = clock_distance_m(v0, v0, safety.clock_error_s)
    closing = speed_difference_distance_m(case.nose_mps, v0, safety.adhesion, safety.resistance)
    return [
        Quantity("2", "L_2", "clock distance, both at v0", clock, "m"),
        Quantity("3", "L_3", "speed distance, v0 behind the ramp's speed", closing, "m"),
        Quantity("1", "L_safe", "safe distance, both at v0", safe, "m"),
        Quantity("4", "L_min s", "least gap by Eq. 1", minimum_gap_m(own_m, safe), "m"),
        Quantity("", "v_Rx", "speed along the mainline at the merge", along, "m/s"),
        Quantity("15", "L_r-X", "distance to the front vehicle at the merge", at_merge, "m"),
        Quantity("16", "L_r-Y", "distance to the rear vehicle at the merge", at_merge, "m"),
        Quantity(
            "17",
            "L_min s",
            "least gap for the merge",
            minimum_merge_gap_m(own_m, at_merge, at_merge),
            "m",
        ),
        Quantity(
            "",
            "",
            "least gap planned: the larger of Eq. 1 and 15 and the allowance, twice",
            case.required_gap_m,
            "m",
        ),
    ]


def free_movement(case: Case) -> list[Quantity]:
    """Returns where and when the vehicle would merge in free movement."""
    v0 = case.v0_mps
    t2_s = acceleration_time_s(v0, case.nose_mps, case.free_mps2)
    merge_m = merge_station_m(case.nose_mps, v0, case.free_mps2)
    return [
        Quantity("24", "t_1", "time to the nose", case.t1_s, "s"),
        Quantity("", "v_R0", "speed at the nose", case.nose_mps, "m/s"),
        Quantity("25", "t_2", "time on the acceleration lane, free movement", t2_s, "s"),
        Quantity("18", "S_R", "merge station, free movement", merge_m, "m"),
    ]


def conflict(case: Case) -> list[Quantity]:
    """Returns what free movement meets, and how severe that is before and after the decision."""
    if math.isnan(case.conflict_m):
        return []
    v0, safety = case.v0_mps, case.rules.safety
    merge_s = case.t1_s + acceleration_time_s(v0, case.nose_mps, case.free_mps2)
    own_m = merge_station_m(case.nose_mps, v0, case.free_mps2)
    other_m = mainline_station_at_merge_m(case.conflict_m, v0, merge_s)
    meets = in_conflict(own_m, other_m, case.length_m, 2.0 * safety.positioning_error_m)
    return [
        Quantity("19", "S_main", "station of the conflict vehicle then", other_m, "m"),
        Quantity("20", "", "in conflict", bool(meets)),
        *severity(case),
    ]


def severity(case: Case) -> list[Quantity]:
    """Returns the severities that the decision recorded, with the collision acceleration."""
    v0 = case.v0_mps
    along = merging_speed_along_mps(v0, case.rules.road.merge_angle_rad)
    collision = collision_acceleration_of_log_ratio_mps2(v0 - along, 0.0)
    lines = [Quantity("8", "a", "collision acceleration at v0, k = 1", collision, "m/s2")]
    for key, when in (("before", "free movement"), ("after", "as planned")):
        printed, relative = (
            case.severities[f"severity_{key}"],
            case.severities[f"relative_severity_{key}"],
        )
        lines += [
            Quantity("5, 9", "J", f"severity, {when}", printed, "m2/s4"),
            Quantity("5, 9", "J", f"severity, relative form of Eq. 9, {when}", relative, "m2/s4"),
        ]
    meaning = "threshold (0.3 g)^2, constrains nothing"
    return [*lines, Quantity("", "J", meaning, SEVERITY_THRESHOLD_M2PS4, "m2/s4")]
