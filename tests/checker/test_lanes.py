"""The checker on several lanes, by hand: A changes from lane 0 to lane 1 at 1 s, and has at 5.5 s.

A cruises at 20 m/s from 0 m. Two that follow each other at that speed need 5.04 m front to front
by Eq. 1, and 0.1 m more.
"""

import math

import numpy as np
import pytest

from coramp.checker.checker import Change, Entry, examine, examine_entry
from coramp.checker.reasons import (
    ACCEPTED,
    CHANGES_LANE_WRONGLY,
    NOT_FINITE,
    TOO_NEAR,
    TOO_NEAR_AT_MERGE,
)
from coramp.checker.record import empty_record, note_command, note_entry
from tests.checker.test_distances import BOUNDS
from tests.mathematics import close, pieces, sized

STREAM, UNDECIDED = -math.inf, math.inf
LANES = BOUNDS._replace(lanes=3, lane_change_lasts_s=4.5)
NEEDED_M = 5.0 + 0.04000012 + 0.1
AWAY = pieces(1.0, 20.0, 20.0)


def cruise(station_m, speed_mps=20.0):
    return pieces(0.0, station_m, speed_mps)


def traffic(*others, merge_s=STREAM, lane=0):
    """A on lane 0, and others: way, lane and, if not on the mainline at entry, merge time."""
    record = empty_record(len(others) + 2, 100)
    for way, own_lane, *merges in ((cruise(0.0), lane, merge_s), *others):
        own_merge_s = merges[0] if merges else STREAM
        note_entry(record, sized(), own_merge_s, way, LANES.zone_end_m, float(own_lane))
    return record


def verdict(record, change_s=1.0, way=AWAY, row=0, merge_s=STREAM, bounds=LANES):
    change = Change(
        np.array([row]),
        np.array([len(way)]),
        way[np.newaxis],
        np.array([merge_s]),
        np.zeros(1, np.int64),
        np.array([change_s]),
    )
    return examine(record, change, 0.5, 1.0, bounds)


@pytest.mark.parametrize("lane", [1, 2])
def test_vehicles_beside_each_other_on_different_lanes_are_in_nobodys_way(lane):
    found = verdict(traffic((cruise(0.0), lane)), change_s=math.inf)
    assert (found.code, found.least_margin_m) == (ACCEPTED, math.inf)


def test_who_changes_past_the_next_lane_is_not_there():
    assert verdict(traffic((cruise(0.0), 2))).code == ACCEPTED


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("more_m", "code"), [(1e-6, ACCEPTED), (-1e-6, TOO_NEAR)])
def test_the_change_keeps_eq_1_to_front_and_rear_on_the_lane_further_in(side, more_m, code):
    found = verdict(traffic((cruise(side * (NEEDED_M + more_m)), 1)))
    assert found.code == code
    assert found.least_margin_m == close(0.1 + more_m)
    if code == TOO_NEAR:
        assert (found.row, found.other_row) == (0, 1)


@pytest.mark.parametrize(("lane", "code"), [(0, ACCEPTED), (1, TOO_NEAR)])
def test_a_faster_vehicle_behind_that_arrives_after_the_change_matters_on_the_new_lane_alone(
    lane, code
):
    # it gains 2 m/s, and has 20 m to go at 0 s: still 4 m away when A has left its lane
    assert verdict(traffic((cruise(-20.0, 22.0), lane))).code == code


def test_the_lane_that_it_leaves_is_its_own_until_it_has_changed():
    # 12 m away at 0 s: 1 m between bumpers after 3 s, while A still counts there
    assert verdict(traffic((cruise(-12.0, 22.0), 0))).code == TOO_NEAR


@pytest.mark.parametrize(("merge_s", "code"), [(5.4, TOO_NEAR_AT_MERGE), (5.5, ACCEPTED)])
def test_a_ramp_vehicle_may_take_the_place_once_it_is_left(merge_s, code):
    record = traffic((cruise(0.0), 0, UNDECIDED))
    record.rows[0, -1] = 1.0  # A changes, as commanded before
    found = verdict(record, math.inf, AWAY, 1, merge_s)
    assert found.code == code


def test_a_command_that_tells_of_no_change_leaves_it_to_an_earlier_one():
    record = traffic((cruise(0.0), 1))
    assert verdict(record, math.inf).code == ACCEPTED
    note_command(record, 0, STREAM, AWAY, 0.5, LANES.zone_end_m, 1.0)
    assert verdict(record, math.inf).code == TOO_NEAR


@pytest.mark.parametrize(
    ("record", "change_s", "merge_s", "bounds", "code"),
    [
        (traffic(), 1.0, STREAM, LANES, ACCEPTED),
        (traffic(), math.nan, STREAM, LANES, NOT_FINITE),
        (traffic(), 0.9, STREAM, LANES, CHANGES_LANE_WRONGLY),
        (traffic(), -math.inf, STREAM, LANES, CHANGES_LANE_WRONGLY),
        (traffic(), 1.0, STREAM, BOUNDS, CHANGES_LANE_WRONGLY),
        (traffic(lane=2), 1.0, STREAM, LANES, CHANGES_LANE_WRONGLY),
        (traffic(merge_s=3.0), 2.9, 3.0, LANES, CHANGES_LANE_WRONGLY),
        (traffic(merge_s=3.0), 3.1, 3.0, LANES, ACCEPTED),
    ],
)
def test_a_change_begins_when_it_can_and_leads_to_a_lane(record, change_s, merge_s, bounds, code):
    assert verdict(record, change_s, merge_s=merge_s, bounds=bounds).code == code


def test_nobody_changes_twice():
    record = traffic()
    note_command(record, 0, STREAM, AWAY, 0.5, LANES.zone_end_m, 1.0)
    assert verdict(record, 7.0).code == CHANGES_LANE_WRONGLY


@pytest.mark.parametrize(("lane", "code"), [(0, TOO_NEAR), (1, ACCEPTED)])
def test_an_entry_is_held_to_who_is_on_its_lane(lane, code):
    way = cruise(-3.0)
    entry = Entry(0.0, -3.0, 20.0, sized(), False, float(lane))
    assert examine_entry(traffic(), entry, way, LANES).code == code
