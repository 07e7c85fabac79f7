"""The record of a merge in heterogeneous traffic: gap, distances and severities as planned."""

import math

from coramp._kernel import FloatArray, kernel
from coramp.equations.conflict_risk import severity_of_masses_m2ps4
from coramp.equations.safe_distance import merge_distance_m, merging_speed_along_mps
from coramp.kinematics.trajectory import SPEED, TIME, station_and_speed
from coramp.road.rules import Rules
from coramp.strategies.situation import RUNG_HOLD, MergePlan
from coramp.strategies.unequal_merge import UnequalMerge
from coramp.vehicles.fleet import Fleet, Proposal, committed, trajectory_under
from coramp.vehicles.merge_state import has_place_on_mainline
from coramp.vehicles.traits import LENGTH, MASS, pair_safety


@kernel
def hold_plan(nose: FloatArray) -> MergePlan:
    """Returns the plan of a vehicle that keeps its stop; ``nose`` is its piece at the nose."""
    no = math.nan
    severities, stations_m = (no, no, no, no), (no, no, no)
    rows, merge = (-1, -1, -1), (no, no, no, no, no, no)
    return MergePlan(RUNG_HOLD, 0, *rows, *merge, *severities, nose[TIME], nose[SPEED], *stations_m)


@kernel
def neighbour_distances_m(
    fleet: Fleet, proposal: Proposal, row: int, merge: UnequalMerge, rules: Rules
) -> tuple[float, float, float]:
    """Returns the gap, the gap needed (Eq. 17), and how much nearer the front vehicle is (m).

    Bumper to bumper at the merge, everyone being where the proposal has it. The gap is infinite
    where there is no vehicle in front or none behind; the last number is at most 0 where the front
    vehicle is the nearer one.
    """
    front_m = rear_m = math.inf
    needed_m = fleet.traits[row, LENGTH]
    along_mps = merging_speed_along_mps(merge.speed_mps, rules.road.merge_angle_rad)
    for other in (merge.front_row, merge.rear_row):
        if other < 0:
            continue
        way = trajectory_under(fleet, proposal, other)
        other_m, other_mps = station_and_speed(way, merge.time_s)
        pair = pair_safety(fleet.traits[other], fleet.traits[row], rules.safety)
        needed_m += merge_distance_m(along_mps, other_mps, pair)
        if other == merge.front_row:
            front_m = other_m - fleet.traits[other, LENGTH] - merge.station_m
        else:
            rear_m = merge.station_m - fleet.traits[row, LENGTH] - other_m
    nearer_m = 0.0 if math.isinf(front_m) and math.isinf(rear_m) else front_m - rear_m
    return front_m + fleet.traits[row, LENGTH] + rear_m, needed_m, nearer_m


@kernel
def unequal_plan(
    fleet: Fleet,
    proposal: Proposal,
    row: int,
    now_s: float,
    nose: FloatArray,
    rung: int,
    merge: UnequalMerge,
    made_way: int,
    rules: Rules,
) -> MergePlan:
    """Returns the plan that a merge of ``row`` amounts to.

    The conflict vehicle is the nearer of the two around the merge. Severities are those between it
    and ``row``, before and after the others adapt. Who ``made_way``, -1 for nobody, is the conflict
    vehicle of its merge, and is on another lane then.
    """
    gap_m, needed_m, nearer_m = neighbour_distances_m(fleet, proposal, row, merge, rules)
    conflict = merge.front_row if nearer_m <= 0.0 else merge.rear_row
    if made_way >= 0:
        conflict = made_way
    before = after = (math.nan, math.nan)
    if conflict >= 0:
        before = _severity(fleet, row, committed(fleet, conflict), conflict, merge, rules)
    if conflict >= 0 and made_way < 0:
        planned = trajectory_under(fleet, proposal, conflict)
        after = _severity(fleet, row, planned, conflict, merge, rules)
    return MergePlan(
        rung,
        2 if merge.moved > 0 else 0,
        conflict,
        merge.front_row,
        merge.rear_row,
        gap_m,
        needed_m,
        merge.accel_mps2,
        merge.time_s,
        merge.station_m,
        _largest_shift_m(fleet, proposal, merge),
        before[0],
        after[0],
        before[1],
        after[1],
        nose[TIME],
        nose[SPEED],
        _station_now_m(fleet, conflict, now_s),
        _station_now_m(fleet, merge.front_row, now_s),
        _station_now_m(fleet, merge.rear_row, now_s),
    )


@kernel
def _station_now_m(fleet: Fleet, row: int, now_s: float) -> float:
    return station_and_speed(committed(fleet, row), now_s)[0] if row >= 0 else math.nan


@kernel
def _severity(
    fleet: Fleet, row: int, way: FloatArray, other: int, merge: UnequalMerge, rules: Rules
) -> tuple[float, float]:
    """Returns J (m2/s4) at the merge with another vehicle's way, as printed and relative."""
    other_m, other_mps = station_and_speed(way, merge.time_s)
    along_mps = merging_speed_along_mps(merge.speed_mps, rules.road.merge_angle_rad)
    distance_m = max(
        other_m - fleet.traits[other, LENGTH] - merge.station_m,
        merge.station_m - fleet.traits[row, LENGTH] - other_m,
    )
    masses = (fleet.traits[row, MASS], fleet.traits[other, MASS])
    return severity_of_masses_m2ps4(along_mps, other_mps, distance_m, *masses)


@kernel
def _largest_shift_m(fleet: Fleet, proposal: Proposal, merge: UnequalMerge) -> float:
    """Returns by how far (m) at most a vehicle that makes room is back when the subject merges."""
    largest_m = 0.0
    for entry in range(1, proposal.size[0]):
        row = proposal.rows[entry]
        if has_place_on_mainline(fleet.merge_time_s[row]):
            was_m, _ = station_and_speed(committed(fleet, row), merge.time_s)
            now_m, _ = station_and_speed(trajectory_under(fleet, proposal, row), merge.time_s)
            largest_m = max(largest_m, was_m - now_m)
    return largest_m
