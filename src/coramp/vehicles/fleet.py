"""The vehicles that a planner knows, and the changes that it proposes, as arrays."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.equations.safe_distance import merge_distance_m, merging_speed_along_mps
from coramp.kinematics.trajectory import MAX_PIECES, station_and_speed, time_at_station
from coramp.road.lanes import LANE_CHANGE_LASTS_S
from coramp.road.rules import Road, Rules, SafetyBudget
from coramp.vehicles.merge_state import is_waiting
from coramp.vehicles.separation import smallest_margin_m
from coramp.vehicles.trace import empty_trace
from coramp.vehicles.traits import LENGTH, pair_safety


class Fleet(NamedTuple):
    """All commitments. A vehicle is a row; ``live`` lists the rows now on the road, by entry.

    Row i's trajectory is ``pieces[first_piece[i] : first_piece[i] + piece_count[i]]``.
    ``merge_time_s`` tells when a vehicle comes onto the mainline, as ``vehicles.merge_state`` reads
    it. ``traits`` are rows of ``vehicles.traits``. ``intercepts_m[i]`` bound ``station - v0 t``,
    below and above, over the trajectory.

    Of several mainline lanes ``live`` has the vehicles of the ramp and of the outermost lane, and
    ``inner`` those of the lanes further in. ``lane`` is the one by which a vehicle came, 0 for the
    outermost and on the ramp. At ``change_s`` it begins to change to the next one (s; infinity for
    never); until it has changed it is in both lists.
    """

    pieces: FloatArray
    first_piece: IntArray
    piece_count: IntArray
    length_m: FloatArray
    merge_time_s: FloatArray
    intercepts_m: FloatArray
    traits: FloatArray
    live: IntArray
    lane: IntArray
    change_s: FloatArray
    inner: IntArray


class Proposal(NamedTuple):
    """New trajectories for some rows; ``size[0]`` of the entries are in use.

    The pieces start where the new trajectory takes over; what lies before stays as committed.
    ``lane_change_s`` is when they begin to change to the next lane further in (s; infinity for
    never). ``trace`` says what was tried for it (``vehicles.trace``).
    """

    size: IntArray
    rows: IntArray
    piece_count: IntArray
    pieces: FloatArray
    merge_time_s: FloatArray
    lane_change_s: FloatArray
    trace: FloatArray


ROUNDING_M = 1e-10
"""What rounding may take from a distance before a planner calls it too small."""
MAX_CHANGED = 32
"""Vehicles that a cascade may change; one that needs more is given up."""


@kernel
def empty_proposal(room: int = MAX_CHANGED) -> Proposal:
    """Returns a proposal that changes nothing, with room for so many vehicles."""
    return Proposal(
        np.zeros(1, np.int64),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty((room, MAX_PIECES, 4)),
        np.empty(room),
        np.full(room, math.inf),
        empty_trace(),
    )


@kernel
def is_full(proposal: Proposal) -> bool:
    """Returns whether the proposal has no room for another vehicle."""
    return bool(proposal.size[0] >= len(proposal.rows))


@kernel
def committed(fleet: Fleet, row: int) -> FloatArray:
    """Returns the trajectory that ``row`` has committed to."""
    start = fleet.first_piece[row]
    return fleet.pieces[start : start + fleet.piece_count[row]]


@kernel
def entry_of(proposal: Proposal, row: int) -> int:
    """Returns the index of ``row`` in the proposal, -1 if it is not changed."""
    return place_among(proposal.rows, proposal.size[0], row)


@kernel
def place_among(rows: IntArray, count: int, row: int) -> int:
    """Returns the place of ``row`` among the first ``count`` of ``rows``, -1 if it is not there."""
    for k in range(count):
        if rows[k] == row:
            return k
    return -1


@kernel
def proposed(proposal: Proposal, entry: int) -> FloatArray:
    """Returns the trajectory of one entry of the proposal."""
    return proposal.pieces[entry, : proposal.piece_count[entry]]


@kernel
def trajectory_under(fleet: Fleet, proposal: Proposal, row: int) -> FloatArray:
    """Returns what ``row`` would drive under the proposal."""
    entry = entry_of(proposal, row)
    if entry >= 0:
        return proposed(proposal, entry)
    return committed(fleet, row)


@kernel
def merge_time_under_s(fleet: Fleet, proposal: Proposal, row: int) -> float:
    """Returns the merge time (s) of ``row`` under the proposal."""
    entry = entry_of(proposal, row)
    if entry >= 0:
        return float(proposal.merge_time_s[entry])
    return float(fleet.merge_time_s[row])


@kernel
def with_change(fleet: Fleet, row: int, change_s: float) -> Fleet:
    """Returns the fleet in which ``row`` begins to change to the next lane further in then (s)."""
    changes_s = fleet.change_s.copy()
    changes_s[row] = change_s
    return Fleet(
        fleet.pieces,
        fleet.first_piece,
        fleet.piece_count,
        fleet.length_m,
        fleet.merge_time_s,
        fleet.intercepts_m,
        fleet.traits,
        fleet.live,
        fleet.lane,
        changes_s,
        fleet.inner,
    )


@kernel
def in_lane(fleet: Fleet, lane: int) -> Fleet:
    """Returns the fleet with those alone as live who are on one lane further in, or change to it.

    Who changes counts on both lanes.
    """
    rows, count = np.empty(len(fleet.inner), np.int64), 0
    for row in fleet.inner:
        changed = 1 if fleet.change_s[row] < math.inf else 0
        if fleet.lane[row] == lane or fleet.lane[row] + changed == lane:
            rows[count] = row
            count += 1
    return Fleet(
        fleet.pieces,
        fleet.first_piece,
        fleet.piece_count,
        fleet.length_m,
        fleet.merge_time_s,
        fleet.intercepts_m,
        fleet.traits,
        rows[:count],
        fleet.lane,
        fleet.change_s,
        fleet.inner,
    )


@kernel
def leaves_lane_s(fleet: Fleet, row: int) -> float:
    """Returns when (s) a vehicle has left its lane for the next one further in, infinity for never.

    It counts on both lanes until then.
    """
    return float(fleet.change_s[row] + LANE_CHANGE_LASTS_S)


class PairSafety(NamedTuple):
    """The budgets of Eq. 1 for two vehicles: if the one leads, and if the other does."""

    one_leads: SafetyBudget
    other_leads: SafetyBudget


@kernel
def ordered_margin_m(
    one: FloatArray,
    one_length_m: float,
    other: FloatArray,
    other_length_m: float,
    start_s: float,
    end_s: float,
    road: Road,
    safety: PairSafety,
) -> float:
    """Returns the smallest margin over Eq. 1 (m) of two vehicles in one lane, whichever leads.

    The one further ahead at ``start_s`` leads; the span ends when it leaves the zone.
    """
    one_m, _ = station_and_speed(one, start_s)
    other_m, _ = station_and_speed(other, start_s)
    if one_m >= other_m:
        end_s = min(end_s, time_at_station(one, road.mainline_end_m))
        margin_m, _ = smallest_margin_m(one, one_length_m, other, start_s, end_s, safety.one_leads)
        return margin_m
    end_s = min(end_s, time_at_station(other, road.mainline_end_m))
    margin_m, _ = smallest_margin_m(other, other_length_m, one, start_s, end_s, safety.other_leads)
    return margin_m


@kernel
def merge_margin_m(
    merging: FloatArray,
    merging_length_m: float,
    other: FloatArray,
    other_length_m: float,
    merge_s: float,
    road: Road,
    safety: SafetyBudget,
) -> float:
    """Returns the margin (m) over Eq. 15 or 16 of a vehicle to another, when it merges."""
    merging_m, merging_mps = station_and_speed(merging, merge_s)
    other_m, other_mps = station_and_speed(other, merge_s)
    if other_m >= merging_m:
        distance_m = other_m - other_length_m - merging_m
    else:
        distance_m = merging_m - merging_length_m - other_m
    along_mps = merging_speed_along_mps(merging_mps, road.merge_angle_rad)
    return distance_m - merge_distance_m(along_mps, other_mps, safety)


@kernel
def pair_margin_m(
    one: FloatArray,
    one_traits: FloatArray,
    one_merge_s: float,
    other: FloatArray,
    other_traits: FloatArray,
    other_merge_s: float,
    from_s: float,
    rules: Rules,
) -> float:
    """Returns the smallest margin (m) of two vehicles from ``from_s`` on, while in one lane.

    Over Eq. 1 on the ramp with its acceleration lane until the first of them merges and on the
    mainline once both are there, and over Eq. 15 or 16 at the moment of that merge. Each vehicle
    counts with its own errors, and the follower with its own time gap.
    """
    road = rules.road
    one_length_m, other_length_m = one_traits[LENGTH], other_traits[LENGTH]
    safety = PairSafety(
        pair_safety(one_traits, other_traits, rules.safety),
        pair_safety(other_traits, one_traits, rules.safety),
    )
    smallest_m = math.inf
    first_merge_s, last_merge_s = min(one_merge_s, other_merge_s), max(one_merge_s, other_merge_s)
    if first_merge_s > from_s:
        smallest_m = ordered_margin_m(
            one, one_length_m, other, other_length_m, from_s, first_merge_s, road, safety
        )
    if is_waiting(last_merge_s):
        return smallest_m
    together_s = max(from_s, last_merge_s)
    on_mainline_m = ordered_margin_m(
        one, one_length_m, other, other_length_m, together_s, math.inf, road, safety
    )
    smallest_m = min(smallest_m, on_mainline_m)
    if last_merge_s >= from_s:
        if one_merge_s >= other_merge_s:
            at_merge_m = merge_margin_m(
                one, one_length_m, other, other_length_m, last_merge_s, road, safety.one_leads
            )
        else:
            at_merge_m = merge_margin_m(
                other, other_length_m, one, one_length_m, last_merge_s, road, safety.one_leads
            )
        smallest_m = min(smallest_m, at_merge_m)
    return smallest_m
