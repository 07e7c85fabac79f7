"""Each rung of the ladder where vehicles differ, by hand, and merges that the checker passes.

The subject drives 16 m/s at -160 m and is at the nose at 10 s. With 2 m/s2 it merges at 12 s at
36 m, like a vehicle that has always cruised at 20 m/s from -204 m.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.checker.checker import Change, examine
from coramp.checker.reasons import ACCEPTED
from coramp.checker.record import empty_record, note_entry
from coramp.coordination.examination import bounds_of
from coramp.road.rules import Traffic, packed
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_DELAY,
    RUNG_FREE,
    RUNG_HOLD,
    RUNG_REACH,
    MergePlan,
)
from coramp.strategies.unequal_ladder import plan_unequal, subject_of
from coramp.strategies.unequal_merge import place_in_order, rows_on_mainline, try_merge
from coramp.vehicles.fleet import Fleet, Proposal, empty_proposal
from coramp.vehicles.traits import standing_behind_m
from tests.mathematics import RULES, close, fleet_of, pieces, sampled, sized, truck

STREAM, UNDECIDED = -math.inf, math.inf
MIXED = RULES._replace(traffic=Traffic(True, 200.0))
STRONG = sized(acceleration_mps2=3.0)
EQ_15 = 0.04 + (3.6 * 20.0 * (1.0 - math.cos(math.pi / 6.0))) ** 2 / 129.54


class Found(NamedTuple):
    plan: MergePlan
    proposal: Proposal
    fleet: Fleet

    @property
    def rows(self):
        return self.proposal.rows[: self.proposal.size[0]].tolist()

    def way(self, entry=0):
        return self.proposal.pieces[entry, : self.proposal.piece_count[entry]]


def plan(*others, own=STRONG, ramp_first=False, rules=MIXED, subject=None):
    way = pieces(0.0, -160.0, 16.0) if subject is None else subject
    fleet = fleet_of((way, UNDECIDED, own), *others)
    found = plan_unequal(fleet, 0, 0.0, 20.0, packed(rules), ramp_first)
    return Found(found[0], found[1], fleet)


def cruising(*intercepts_m, traits=None):
    return [
        (pieces(0.0, s, 20.0), STREAM, sized() if traits is None else traits) for s in intercepts_m
    ]


def checked(found, rules=MIXED):
    """The checker's verdict on a proposal, from a record of its own."""
    fleet, proposal = found.fleet, found.proposal
    bounds, n = bounds_of(rules), found.proposal.size[0]
    record = empty_record(len(fleet.live) + 1, 2000)
    for row in range(len(fleet.live)):
        first = fleet.first_piece[row]
        way = fleet.pieces[first : first + fleet.piece_count[row]]
        note_entry(record, fleet.traits[row], fleet.merge_time_s[row], way, bounds.zone_end_m)
    change = Change(
        proposal.rows[:n],
        proposal.piece_count[:n],
        proposal.pieces[:n],
        proposal.merge_time_s[:n],
        (np.arange(n) > 0).astype(np.int64),
        proposal.lane_change_s[:n],
    )
    return examine(record, change, 0.0, rules.control.actuation_delay_s, bounds)


# free ---------------------------------------------------------------------------------------


def test_alone_a_strong_vehicle_merges_by_free_movement():
    found = plan()
    assert found.plan.rung == RUNG_FREE
    assert (found.plan.merge_time_s, found.plan.merge_station_m) == (close(12.0), close(36.0))
    assert found.plan.accel_mps2 == 2.0
    assert found.way()[:, 1:] == close(
        np.array([[-158.4, 16.0, 0.0], [0.0, 16.0, 2.0], [36.0, 20.0, 0.0]])
    )
    assert (found.plan.front_row, found.plan.rear_row, found.plan.conflict_row) == (-1, -1, -1)


def test_a_truck_merges_at_the_last_step_of_the_lane_and_speeds_up_on_the_mainline_by_hand():
    found = plan(own=truck())
    # bands of 4/3 m/s at 5.5 W/kg over the speed at their ends: 70.03 m in 4.202 s, 81.45 m in
    # 4.525 s, then 0.275 m/s2; 197.5 m would be reached at 21.15 s
    first, second = 5.5 / (16.0 + 4.0 / 3.0), 5.5 / (16.0 + 8.0 / 3.0)
    assert found.way()[1:, 3].tolist() == [close(first), close(second), close(0.275), 0.0]
    assert found.plan.rung == RUNG_FREE
    assert found.plan.merge_time_s == close(21.1)
    third_s = 10.0 + (4.0 / 3.0) / first + (4.0 / 3.0) / second
    x = 21.1 - third_s
    third_m = 50.0 / 1.5 * (4.0 / 3.0) / first * 0.5 + (52.0 + 2.0) / 1.5 * 0.5 * (4 / 3) / second
    assert third_m == pytest.approx(151.488, abs=1e-3)
    merge_m = third_m + (16.0 + 8.0 / 3.0) * x + 0.1375 * x * x
    assert found.plan.merge_station_m == close(merge_m)
    assert merge_m < 197.5 < merge_m + 2.0
    assert found.way()[-1, 2] == 20.0
    assert checked(found).code == ACCEPTED


def test_a_merge_lies_on_the_control_clock():
    for own in (STRONG, truck(), sized(acceleration_mps2=1.3)):
        steps = plan(own=own).plan.merge_time_s / 0.1
        assert steps == close(round(steps))


# reach --------------------------------------------------------------------------------------


def test_another_acceleration_reaches_the_gap_behind_by_hand():
    # an acceleration a ends 200 + 8 / a m back; from the least, (400 - 256) / 395, to 3 m/s2 in six
    # equal ratios: the third has 210.87 m, and behind a car at -204 m 209.86 m are enough
    least = 144.0 / 395.0
    tried = least * (3.0 / least) ** (np.arange(7) / 6.0)
    assert 200.0 + 8.0 / tried[2] > 204.0 + 5.0 + EQ_15 + 0.1 > 200.0 + 8.0 / tried[3]
    found = plan(*cruising(-204.0))
    assert found.plan.rung == RUNG_REACH
    assert found.plan.accel_mps2 == close(tried[2])
    assert found.rows == [0]
    assert (found.plan.front_row, found.plan.conflict_row) == (1, 1)
    assert checked(found).code == ACCEPTED


# create -------------------------------------------------------------------------------------


def test_under_ramp_priority_the_one_behind_drops_back_by_hand():
    # at -208 m it is 4 m behind at the merge; 5 m of the subject, Eq. 16 and the allowance are
    # needed. A dip of D loses D^2 / 2 (1 / 2 + 1 / 1.5), in steps of 2 m/s / 32
    missing_m = 5.0 + EQ_15 + 0.1 - 4.0
    dip = math.ceil(math.sqrt(missing_m / (0.5 * (0.5 + 1.0 / 1.5))) * 16.0) / 16.0
    found = plan(*cruising(-208.0), ramp_first=True)
    assert found.plan.rung == RUNG_CREATE
    assert found.rows == [0, 1]
    assert found.plan.accel_mps2 == 2.0
    assert found.way(1)[1, 2] == close(20.0 - dip)
    assert found.plan.largest_shift_m == close(dip**2 * 0.5 * (0.5 + 1.0 / 1.5))
    assert (found.plan.front_row, found.plan.rear_row) == (-1, 1)
    assert checked(found).code == ACCEPTED


def test_the_chain_behind_gives_way_front_first():
    found = plan(*cruising(-208.0, -213.5, -219.0), ramp_first=True)
    assert found.plan.rung == RUNG_CREATE
    assert found.rows == [0, 1, 2, 3]
    assert checked(found).code == ACCEPTED


def test_nobody_is_asked_who_is_far_enough_behind():
    found = plan(*cruising(-208.0, -240.0), ramp_first=True)
    assert found.rows == [0, 1]


def test_under_mainline_priority_room_is_made_where_no_acceleration_does():
    # cars 4.5 m apart over all that accelerations reach: 5 m and twice 0.86 m are needed. With
    # 2 m/s2 it is 0.9 m behind X; Y, 3.6 m behind, can drop back by 2.26 m
    dense = cruising(*(-198.1 - 9.5 * k for k in range(7)))
    found = plan(*dense)
    assert found.plan.rung == RUNG_CREATE
    assert found.rows == [0, 2]
    assert (found.plan.front_row, found.plan.rear_row) == (1, 2)
    assert checked(found).code == ACCEPTED


def candidates(found):
    """What each acceleration that is tried would move and cost with room made for it."""
    subject = subject_of(found.fleet, 0, 0.0, 20.0, MIXED)
    for accel_mps2 in [subject.free_mps2, *subject.tried_mps2]:
        way = (empty_proposal(), 0, subject.approach, accel_mps2, True, subject.known_m, MIXED)
        merge = try_merge(found.fleet, *way)
        if merge.done:
            yield (merge.moved, merge.lost_s), float(accel_mps2)


def test_of_merges_that_need_room_it_takes_the_one_that_moves_fewest_and_costs_them_least():
    rng = np.random.default_rng(1)
    choices, by_number = 0, 0
    for _ in range(300):
        dense = cruising(*(-196.0 - np.cumsum(rng.uniform(5.3, 11.5, 8))).tolist())
        found = plan(*dense)
        if found.plan.rung != RUNG_CREATE:
            continue
        known = list(candidates(found))
        best = min(cost for cost, _ in known)
        assert found.plan.accel_mps2 in [accel for cost, accel in known if cost == best]
        assert len(found.rows) - 1 == best[0]
        choices += len({cost for cost, _ in known}) > 1
        by_number += len({cost[0] for cost, _ in known}) > 1
    assert choices > 5
    assert by_number > 1


def test_severity_is_that_of_the_lighter_vehicle_at_the_merge_by_hand():
    # a truck of 40 t drops back behind a car that merges 4 m ahead of it
    heavy = truck(power_wpkg=50.0, acceleration_mps2=3.0)
    found = plan(*cruising(-208.0, traits=heavy), ramp_first=True)
    assert found.plan.rung == RUNG_CREATE
    # before: they overlap. After: 4 m less the car's 5 m, plus the shift
    assert found.plan.severity_before == math.inf
    gap_m = 4.0 - 5.0 + found.plan.largest_shift_m
    along_mps = 20.0 * math.cos(math.pi / 6.0)
    dv_mps = 20.0 - along_mps
    expected = dv_mps / (1.0375 * 0.2) * (400.0 - along_mps**2) / (2.0 * gap_m)
    assert found.plan.severity_after == close(expected)


# delay and hold -----------------------------------------------------------------------------


def test_it_comes_later_by_as_little_as_helps_by_hand():
    # ramp priority keeps 2 m/s2; a car at -204 m stands in the way and can drop back by 2.33 m
    # at most. Half a second later the subject is 5 m behind it: 10 m less the car's length
    found = plan(*cruising(-204.0), ramp_first=True)
    assert found.plan.rung == RUNG_DELAY
    assert found.plan.nose_time_s == close(10.0)  # of the way that was looked for
    assert found.plan.merge_time_s == close(12.5)
    assert found.plan.merge_station_m == close(36.0)
    assert found.rows == [0]
    assert checked(found).code == ACCEPTED


def test_it_holds_where_someone_yet_to_enter_could_be_held_up():
    # the mainline begins at the nose: whoever enters now is ahead of all that it reaches
    short = MIXED._replace(road=RULES.road._replace(mainline_start_m=0.0))
    found = plan(rules=short)
    assert found.plan.rung == RUNG_HOLD
    assert found.rows == []
    assert math.isnan(found.plan.merge_time_s)


def test_one_that_stands_gets_away_nevertheless():
    short = MIXED._replace(road=RULES.road._replace(mainline_start_m=0.0))
    stands = pieces(0.0, -1.0, 0.0)
    found = plan(rules=short, subject=stands)
    assert found.plan.rung == RUNG_FREE


@pytest.mark.parametrize("clock_s", [3e-9, 0.02, 0.2])
@pytest.mark.parametrize("braking_mps2", [math.inf, 0.9])
def test_one_that_stands_gets_away_from_one_that_stands_behind(clock_s, braking_mps2):
    ahead, behind = sized(clock_error_s=clock_s), sized(braking_mps2=braking_mps2)
    place_m = -1.0 - 5.0 - standing_behind_m(ahead, behind, MIXED)
    waits = (pieces(0.0, place_m, 0.0), UNDECIDED, behind)
    found = plan(waits, own=ahead, subject=pieces(0.0, -1.0, 0.0))
    assert found.plan.rung == RUNG_FREE
    assert checked(found).code == ACCEPTED


def test_a_lane_that_is_full_for_ever_holds_it():
    # 5.2 m apart, each 5 m long, so that nobody can drop back: 40 s of them
    full = cruising(*(-150.0 - 5.2 * k for k in range(180)))
    found = plan(*full, ramp_first=True)
    assert found.plan.rung == RUNG_HOLD
    assert found.rows == []


# slower vehicles ----------------------------------------------------------------------------


def test_behind_a_slower_truck_it_merges_at_its_speed_and_follows():
    # the truck, at 17 m/s, is at 60 m at 12 s; the subject is to be behind it for good
    slow = truck(top_speed_mps=17.0)
    found = plan((pieces(0.0, 60.0 - 204.0, 17.0), STREAM, slow))
    assert found.plan.rung in (RUNG_FREE, RUNG_REACH)
    _, merge_mps = sampled(found.way(), np.array([found.plan.merge_time_s]))
    assert merge_mps[0] <= 17.0 + 0.1
    assert found.way()[-1, 2] == close(17.0)
    assert found.plan.front_row == 1
    assert checked(found).code == ACCEPTED


def test_who_is_ahead_is_told_at_the_time_of_the_merge():
    # the truck is ahead now and behind at 12 s
    fleet = fleet_of(
        (pieces(0.0, -160.0, 16.0), UNDECIDED),
        (pieces(0.0, -100.0, 5.0), STREAM),
        (pieces(0.0, -150.0, 20.0), STREAM),
        (pieces(0.0, -170.0, 16.0), UNDECIDED),
        (pieces(0.0, -90.0, 16.0), 9.0),
    )
    assert rows_on_mainline(fleet, 0, 0.0).tolist() == [4, 1, 2]
    order = rows_on_mainline(fleet, 0, 12.0)
    assert order.tolist() == [4, 2, 1]  # at 102, 90 and -40 m
    assert [place_in_order(fleet, order, s, 12.0) for s in (110.0, 95.0, 0.0, -50.0)] == [
        0,
        1,
        2,
        3,
    ]


own = st.builds(
    sized,
    st.sampled_from([5.0, 16.5]),
    positioning_error_m=st.sampled_from([0.02, 0.6]),
    clock_error_s=st.sampled_from([3e-9, 0.02]),
    time_gap_s=st.sampled_from([0.0, 0.5, 1.2]),
    top_speed_mps=st.sampled_from([math.inf, 19.0, 16.0]),
    acceleration_mps2=st.sampled_from([math.inf, 1.0]),
    power_wpkg=st.sampled_from([math.inf, 5.5]),
    braking_mps2=st.sampled_from([math.inf, 2.5, 1.4]),
    mass_kg=st.sampled_from([1500.0, 40000.0]),
)


@st.composite
def mainlines(draw):
    others, station_m = [], draw(st.floats(-190.0, -100.0))
    for _ in range(draw(st.integers(1, 8))):
        traits = draw(own)
        speed_mps = min(draw(st.sampled_from([20.0, 20.0, 17.0])), traits[4])
        others.append((pieces(0.0, station_m, speed_mps), STREAM, traits))
        station_m -= traits[0] + draw(st.sampled_from([0.3, 3.0, 10.0, 30.0]))
    return others


@settings(max_examples=150)
@given(others=mainlines(), subject=own, ramp_first=st.booleans(), slower=st.floats(12.0, 16.0))
def test_the_checker_passes_whatever_is_proposed(others, subject, ramp_first, slower):
    way = pieces(0.0, -160.0, min(slower, subject[4]))
    found = plan(*others, own=subject, ramp_first=ramp_first, subject=way)
    if found.plan.rung == RUNG_HOLD:
        assert found.rows == []
        return
    assert checked(found).code == ACCEPTED
    assert found.rows[0] == 0
    if found.plan.rung in (RUNG_FREE, RUNG_REACH):
        assert found.rows == [0]
    assert 0.0 < found.plan.merge_station_m <= RULES.road.last_merge_station_m + 1e-6
    # nobody ahead of the merge is touched
    ahead = rows_on_mainline(found.fleet, 0, found.plan.merge_time_s)
    place = place_in_order(found.fleet, ahead, found.plan.merge_station_m, found.plan.merge_time_s)
    assert not set(found.rows[1:]) & set(ahead[:place].tolist())
