"""The independent checker, on a merge between X and Y that a second ramp vehicle Q watches.

At 20 m/s X and Y are 28 m apart. R drives 16 m/s from -160 m, would stop at -10 m, and is now to
accelerate by 2 m/s2 from the nose (10 s) and merge at 12 s at 36 m. X is then at 51 m and Y at
23 m: 10 m and 8 m between bumpers, of which Eq. 15 and 16 ask 0.7583 m. Each test breaks one
thing.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest

from coramp.checker.checker import Change, examine
from coramp.checker.pairs import envelope_on_mainline, examine_pair, surely_apart, way_with
from coramp.checker.reasons import (
    ACCEPTED,
    BACKWARDS,
    CHANGES_THE_PAST,
    HAS_A_JUMP,
    LEAVES_ITS_PATH,
    MERGES_OUTSIDE_LANE,
    NO_SAFE_END,
    NOT_FINITE,
    REASONS,
    STARTS_TOO_EARLY,
    STARTS_TOO_LATE,
    TAKES_NO_COMMANDS,
    TIMES_NOT_ASCENDING,
    TOO_FAST,
    TOO_HARD,
    TOO_NEAR,
    TOO_NEAR_AT_MERGE,
)
from coramp.checker.record import LIVE, empty_record, note_entry
from tests.checker.test_distances import BOUNDS
from tests.mathematics import close, pieces, sampled, sized

STREAM, UNDECIDED = -math.inf, math.inf
X, Y, R, Q = range(4)
L_R = 0.7583002436540073  # Eq. 15 and 16 at 20 m/s
CRUISE = 0.04000012  # Eq. 1 of two vehicles at 20 m/s

X_WAY = pieces(0.0, -189.0, 20.0)
Y_WAY = pieces(0.0, -217.0, 20.0)
R_WAY = pieces(0.0, -160.0, 16.0, [(16.0, 6.175), (0.0, 6.4)])  # to a stand at -10 m
Q_WAY = pieces(0.0, -190.0, 16.0, [(16.0, 7.425), (0.0, 6.4)])  # to a stand at -20 m
MERGE = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (20.0, 2.0)])


class New(NamedTuple):
    """One new trajectory; it takes over where the vehicle is then, if nothing else is said."""

    row: int
    pieces: np.ndarray
    merge_s: float
    makes_gap: int = 0
    change_s: float = math.inf


def traffic(*vehicles, live=None):
    """What was told of ``(pieces, merge time)``, 5 m long unless a length, or traits, follow."""
    record = empty_record(len(vehicles) + 1, 1000)
    for vehicle in vehicles:
        own = vehicle[2] if len(vehicle) > 2 else 5.0
        traits = sized(own) if np.isscalar(own) else own
        note_entry(record, traits, vehicle[1], vehicle[0], BOUNDS.zone_end_m)
    if live is not None:
        record.live[: len(live)] = live
        record.used[LIVE] = len(live)
    return record


def _way(way, merge_s):
    return way_with(way, merge_s, sized())


ROAD = ((X_WAY, STREAM), (Y_WAY, STREAM), (R_WAY, UNDECIDED), (Q_WAY, UNDECIDED))


def verdict(*new, vehicles=ROAD, live=None, now_s=-math.inf, earliest_s=1.0, bounds=BOUNDS):
    buffer = np.zeros((len(new), 12, 4))
    for k, one in enumerate(new):
        buffer[k, : len(one.pieces)] = one.pieces
    change = Change(
        rows=np.array([one.row for one in new]),
        piece_count=np.array([len(one.pieces) for one in new]),
        pieces=buffer,
        merge_s=np.array([one.merge_s for one in new]),
        makes_gap=np.array([one.makes_gap for one in new]),
        lane_change_s=np.array([one.change_s for one in new]),
    )
    record = traffic(*vehicles, live=live)
    return examine(record, change, now_s, earliest_s, bounds)


def alone(way, merge_s=STREAM, makes_gap=0, committed=None, committed_merge_s=None):
    """The verdict's code for a vehicle with nobody else on the road."""
    committed = way if committed is None else committed
    committed_merge_s = merge_s if committed_merge_s is None else committed_merge_s
    new = New(0, way, merge_s, makes_gap)
    return verdict(new, vehicles=[(committed, committed_merge_s)], earliest_s=way[0, 0]).code


def moved(way, column, value, row=-1):
    changed = way.copy()
    changed[row, column] = value
    return changed


def aside(way, from_s, start_s, lasts_s, shift_m):
    """A cruise that gains ``shift_m`` by Eq. 42 and 43."""
    v, half_s = way[0, 2], lasts_s / 2.0
    station_m = sampled(way, np.array([from_s]))[0][0]
    stretches = [(v + shift_m / half_s, half_s), (v, half_s)]
    if start_s > from_s:
        stretches.insert(0, (v, start_s - from_s))
    return pieces(from_s, station_m, v, stretches)


# accepted -----------------------------------------------------------------------------------


def test_merge_into_the_gap_is_accepted_with_its_least_margin():
    found = verdict(New(R, MERGE, 12.0))
    assert (found.code, found.row, found.other_row) == (ACCEPTED, -1, -1)
    assert found.least_margin_m == close(8.0 - L_R)


def test_merge_with_a_gap_maker_is_accepted_with_its_least_margin():
    # Y falls back 1 m: 9 m behind; X's 10 m are the least now
    back = aside(Y_WAY, 1.0, 2.0, 6.0, -1.0)
    found = verdict(New(R, MERGE, 12.0), New(Y, back, STREAM, 1))
    assert found.code == ACCEPTED
    assert found.least_margin_m == close(9.0 - L_R)


def test_every_reason_has_its_words():
    assert len(REASONS) == 18
    assert len(set(REASONS)) == 18


# form ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("column", range(4))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_values_must_be_finite(column, value):
    found = verdict(New(R, moved(MERGE, column, value), 12.0))
    assert found.code == NOT_FINITE
    assert (found.row, found.other_row) == (R, -1)
    assert math.isnan(found.least_margin_m)


def test_merge_time_must_be_a_number():
    assert verdict(New(R, MERGE, math.nan)).code == NOT_FINITE


def test_there_must_be_pieces():
    assert verdict(New(R, MERGE[:0], 12.0)).code == NOT_FINITE


def test_later_entries_are_examined_too():
    found = verdict(New(R, MERGE, 12.0), New(Y, moved(Y_WAY, 1, math.nan), STREAM))
    assert (found.code, found.row) == (NOT_FINITE, Y)


def test_times_must_ascend():
    twice = MERGE[[0, 1, 1, 2]]
    assert verdict(New(R, twice, 12.0)).code == TIMES_NOT_ASCENDING
    back = np.array([MERGE[0], [10.5, 8.0, 16.0, 0.0], MERGE[1], MERGE[2]])
    assert verdict(New(R, back, 12.0)).code == TIMES_NOT_ASCENDING


@pytest.mark.parametrize("column", [1, 2])
@pytest.mark.parametrize("row", [1, 2])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_pieces_must_join_in_station_and_speed(column, row, side):
    for size, code in ((2e-6, HAS_A_JUMP), (5e-7, ACCEPTED)):
        jump = MERGE.copy()
        if column == 1:
            jump[row:, 1] += side * size
        else:
            jump[row, 2] += side * size
        assert verdict(New(R, jump, 12.0)).code == code


# start --------------------------------------------------------------------------------------


def test_start_must_not_lie_before_the_vehicle_can_act():
    assert verdict(New(R, MERGE, 12.0), earliest_s=1.0 + 5e-7).code == ACCEPTED
    assert verdict(New(R, MERGE, 12.0), earliest_s=1.0 + 2e-6).code == STARTS_TOO_EARLY


def test_nothing_that_is_driven_may_be_missing():
    # it would brake from 5 s on; run back from there it would count 16 m behind where it is until
    # then, and whoever merges into its real place would be let in
    assert verdict(New(R, MERGE, 12.0), earliest_s=1.0 - 5e-7).code == ACCEPTED
    assert verdict(New(R, MERGE, 12.0), earliest_s=1.0 - 2e-6).code == STARTS_TOO_LATE
    later = pieces(5.0, -89.0, 20.0, [(18.0, 1.0), (20.0, 2.0)])
    assert verdict(New(X, later, STREAM)).code == STARTS_TOO_LATE
    assert verdict(New(X, later, STREAM), earliest_s=5.0).code == ACCEPTED


@pytest.mark.parametrize("column", [1, 2])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_start_must_be_where_the_vehicle_is(column, side):
    for size, code in ((2e-6, LEAVES_ITS_PATH), (5e-7, ACCEPTED)):
        told = R_WAY.copy()
        told[:2, column] += side * size
        road = (*ROAD[:2], (told, UNDECIDED), *ROAD[3:])
        assert verdict(New(R, MERGE, 12.0), vehicles=road).code == code


# the past -----------------------------------------------------------------------------------


@pytest.mark.parametrize("row", [-2, -1, len(ROAD)])
def test_who_was_never_told_of_takes_no_commands(row):
    found = verdict(New(R, MERGE, 12.0), New(row, MERGE, 12.0))
    assert (found.code, found.row) == (TAKES_NO_COMMANDS, row)


@pytest.mark.parametrize("merge_s", [12.0, UNDECIDED])
def test_stream_cannot_be_changed(merge_s):
    found = verdict(New(X, aside(X_WAY, 1.0, 2.0, 6.0, 1.0), merge_s))
    assert (found.code, found.row) == (CHANGES_THE_PAST, X)


def test_lane_change_that_has_happened_stays():
    before = [*ROAD[:2], (R_WAY, 0.5), ROAD[3]]
    assert verdict(New(R, MERGE, 12.0), vehicles=before).code == CHANGES_THE_PAST


def test_lane_change_cannot_lie_in_the_past():
    assert verdict(New(R, MERGE, 0.5)).code == CHANGES_THE_PAST
    assert verdict(New(R, MERGE, STREAM)).code == CHANGES_THE_PAST


def test_lane_change_to_come_can_be_given_up_or_moved():
    committed = [*ROAD[:2], (MERGE, 12.0), ROAD[3]]
    stop = np.array([[1.0, -144.0, 16.0, 0.0], *R_WAY[1:]])
    assert verdict(New(R, stop, UNDECIDED), vehicles=committed).code == ACCEPTED
    assert verdict(New(R, MERGE, 12.1), vehicles=committed).code == ACCEPTED


def test_lane_change_at_the_very_moment_of_taking_over_is_still_to_come():
    lane = pieces(1.0, 50.0, 18.0, [(20.0, 1.0)])
    assert alone(lane, 3.0, committed_merge_s=1.0) == ACCEPTED
    assert alone(lane, 1.0, committed_merge_s=UNDECIDED) == ACCEPTED
    # and is asked for its station and its distance
    assert alone(MERGE, 1.0, committed_merge_s=UNDECIDED) == MERGES_OUTSIDE_LANE
    # 0.6 m between bumpers at 18 m/s: (3.6 (18 - 18 cos 30))^2 / 129.54 = 0.58 and 0.04 m are asked
    road = [(lane, UNDECIDED), (pieces(0.0, 26.4, 18.0), STREAM)]
    assert verdict(New(0, lane, 1.0), vehicles=road).code == TOO_NEAR_AT_MERGE


def test_merged_vehicle_may_move_on_the_mainline():
    way = pieces(301.0, 290.0, 20.0, [(19.0, 2.0), (20.0, 2.0)])  # it was at 280 m at its merge
    assert alone(way, 300.5) == ACCEPTED


# end ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("accel_mps2", [0.01, -0.01])
def test_end_must_be_a_cruise(accel_mps2):
    assert verdict(New(R, moved(MERGE, 3, accel_mps2), 12.0)).code == NO_SAFE_END


def test_undecided_vehicle_must_come_to_a_stand():
    assert alone(pieces(1.0, -144.0, 16.0), UNDECIDED) == NO_SAFE_END
    assert alone(pieces(1.0, -144.0, 16.0, [(1e-6, 16.0)]), UNDECIDED) == NO_SAFE_END


@pytest.mark.parametrize(("stop_m", "code"), [(-1.0, ACCEPTED), (-0.999, NO_SAFE_END)])
def test_undecided_vehicle_must_stand_before_the_nose(stop_m, code):
    assert alone(pieces(1.0, stop_m - 64.0, 16.0, [(0.0, 8.0)]), UNDECIDED) == code


def test_merging_vehicle_must_not_end_in_a_stand():
    for speed_mps, code in ((0.0, NO_SAFE_END), (0.1, ACCEPTED)):
        way = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (20.0, 2.0), (speed_mps, 10.0)])
        assert alone(way, 12.0) == code


@pytest.mark.parametrize(("speed_mps", "code"), [(20.0, ACCEPTED), (20.001, NO_SAFE_END)])
def test_end_must_not_be_faster_than_the_mainline(speed_mps, code):
    assert alone(pieces(1.0, -144.0, 20.001, [(speed_mps, 2.0)])) == code


# merge station ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("merge_s", "code"),
    [
        (5.0, MERGES_OUTSIDE_LANE),  # at -80 m
        (10.0, MERGES_OUTSIDE_LANE),  # at 0 m
        (10.001, ACCEPTED),
        (20.075, ACCEPTED),  # 36 + 161.5 m
        (20.1, MERGES_OUTSIDE_LANE),  # 198 m, beyond 197.5 m
    ],
)
def test_merge_must_be_beside_the_acceleration_lane(merge_s, code):
    assert alone(MERGE, merge_s, committed=R_WAY, committed_merge_s=UNDECIDED) == code


# speeds -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("speed_mps", "code"), [(17.0, ACCEPTED), (17.001, TOO_FAST)])
def test_ramp_has_its_limit(speed_mps, code):
    way = pieces(1.0, -144.0, 16.0, [(speed_mps, 2.0), (16.0, 2.0), (0.0, 6.4)])
    assert way[-1, 1] < -1.0
    assert alone(way, UNDECIDED) == code
    onwards = pieces(1.0, -144.0, 16.0, [(speed_mps, 2.0), (speed_mps, 8.0), (20.0, 2.0)])
    assert onwards[2, 1] > 0.0
    assert alone(onwards, 13.0) == code


def test_acceleration_lane_and_mainline_have_that_of_the_mainline():
    lane = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (20.1, 2.0), (20.0, 1.0)])
    assert alone(lane, 13.0) == TOO_FAST
    assert alone(pieces(1.0, -300.0, 20.0, [(20.1, 2.0), (20.0, 2.0)])) == TOO_FAST


def test_mainline_beside_the_ramp_has_no_ramp_limit():
    assert alone(pieces(1.0, -300.0, 20.0, [(18.0, 2.0), (20.0, 2.0)])) == ACCEPTED


def test_vehicle_that_enters_too_fast_slows_down_from_there():
    assert alone(pieces(1.0, -300.0, 23.0, [(23.0, 1.0), (20.0, 2.0)])) == ACCEPTED
    assert alone(pieces(1.0, -300.0, 23.0, [(23.1, 1.0), (20.0, 2.0)])) == TOO_FAST
    ramp = pieces(1.0, -300.0, 18.0, [(18.0, 1.0), (16.0, 1.0), (0.0, 8.0)])
    assert alone(ramp, UNDECIDED) == ACCEPTED


@pytest.mark.parametrize(
    ("shift_m", "code"),
    [(9.9, ACCEPTED), (10.1, TOO_FAST)],  # 1.98 and 2.02 m/s more over 10 s
)
def test_gap_maker_may_be_a_tenth_faster(shift_m, code):
    ahead = aside(X_WAY, 1.0, 1.0, 10.0, shift_m)
    assert verdict(New(R, MERGE, 12.0), New(X, ahead, STREAM, 1)).code == code


def test_gap_maker_that_is_faster_yet_as_committed_may_slow_down_from_there():
    entering = pieces(0.0, -160.0, 23.0, [(23.0, 3.0), (20.0, 2.0)])
    onwards = np.array([[1.0, -137.0, 23.0, 0.0], *entering[1:]])
    road = [(entering, STREAM), *ROAD[1:]]
    assert verdict(New(R, MERGE, 12.0), New(0, onwards, STREAM, 1), vehicles=road).code == ACCEPTED


def test_only_a_gap_maker_may_be_faster():
    ahead = aside(X_WAY, 1.0, 1.0, 10.0, 1.0)
    assert verdict(New(R, MERGE, 12.0), New(X, ahead, STREAM, 0)).code == TOO_FAST


def test_gap_maker_may_be_faster_only_until_the_merge():
    in_time, late = (aside(X_WAY, 1.0, start_s, 4.0, 1.0) for start_s in (8.0, 10.0))
    assert verdict(New(R, MERGE, 12.0), New(X, in_time, STREAM, 1)).code == ACCEPTED
    assert verdict(New(R, MERGE, 12.0), New(X, late, STREAM, 1)).code == TOO_FAST
    assert verdict(New(X, in_time, STREAM, 1), New(R, MERGE, 12.0)).code == ACCEPTED


def test_gap_maker_needs_somebody_who_merges():
    ahead = aside(X_WAY, 1.0, 1.0, 10.0, 1.0)
    assert verdict(New(X, ahead, STREAM, 1)).code == TOO_FAST
    stop = np.array([[1.0, -144.0, 16.0, 0.0], *R_WAY[1:]])
    assert verdict(New(R, stop, UNDECIDED), New(X, ahead, STREAM, 1)).code == TOO_FAST


def test_merge_of_a_gap_maker_gives_no_other_one_more_time():
    # a vehicle far ahead that is to merge at 16 s moves aside too
    far = pieces(0.0, -70.0, 16.0, [(16.0, 14.0), (20.0, 2.0)])
    road = [*ROAD[:3], (far, 16.0)]
    again = pieces(1.0, -54.0, 16.0, [(16.0, 13.0), (20.0, 2.0)])
    late = aside(X_WAY, 1.0, 11.0, 4.0, 1.0)  # fastest at 13 s
    new = New(R, MERGE, 12.0), New(X, late, STREAM, 1)
    assert verdict(*new, New(3, again, 16.0, 1), vehicles=road).code == TOO_FAST
    assert verdict(*new, New(3, again, 16.0, 0), vehicles=road).code == ACCEPTED
    assert verdict(New(3, again, 16.0, 0), *new, vehicles=road).code == ACCEPTED


def test_gap_maker_before_its_own_merge_has_the_ordinary_limits():
    way = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (20.5, 2.0), (20.0, 1.0)])  # fastest at 12 s
    late = New(1, pieces(1.0, -384.0, 16.0, [(16.0, 24.0), (20.0, 2.0)]), 27.0)
    for merge_s, code in ((11.5, ACCEPTED), (12.5, TOO_FAST)):
        committed = [(R_WAY, merge_s), (pieces(0.0, -400.0, 16.0), UNDECIDED)]
        assert verdict(New(0, way, merge_s, 1), late, vehicles=committed).code == code


def test_gap_maker_may_be_as_fast_as_it_was_committed_to_be():
    # 1.5 m/s more over 2 to 8 s are committed; 21.2 m/s at the end of what is driven again
    committed = aside(X_WAY, 0.0, 2.0, 6.0, 4.5)
    start_m, start_mps = (value[0] for value in sampled(committed, np.array([4.0])))
    assert start_mps == close(21.0)
    onwards = pieces(4.0, start_m, 21.0, [(21.2, 0.8), (20.0, 1.2)])
    assert alone(onwards, STREAM, 1, committed) == ACCEPTED
    faster = pieces(4.0, start_m, 21.0, [(21.6, 0.8), (20.0, 1.2)])
    assert alone(faster, STREAM, 1, committed) == TOO_FAST


def test_nobody_drives_backwards():
    way = pieces(1.0, -300.0, 20.0, [(-0.001, 10.0), (20.0, 10.0)])
    assert alone(way) == BACKWARDS
    assert alone(pieces(1.0, -300.0, 20.0, [(0.0, 10.0), (20.0, 10.0)])) == ACCEPTED


# accelerations ------------------------------------------------------------------------------


@pytest.mark.parametrize(("rate_mps2", "code"), [(2.94, ACCEPTED), (2.941, TOO_HARD)])
def test_mainline_keeps_to_comfort_both_ways(rate_mps2, code):
    down_first = pieces(1.0, -300.0, 20.0, [(20.0 - rate_mps2, 1.0), (20.0, 2.0)])
    up_last = pieces(1.0, -300.0, 20.0, [(20.0 - rate_mps2, 2.0), (20.0, 1.0)])
    assert alone(down_first) == code
    assert alone(up_last) == code


@pytest.mark.parametrize(("rate_mps2", "code"), [(6.0, ACCEPTED), (6.001, TOO_HARD)])
def test_acceleration_lane_has_its_own_bound(rate_mps2, code):
    way = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (20.0, 4.0 / rate_mps2)])
    assert alone(way, 10.0 + 4.0 / rate_mps2) == code


def test_ramp_keeps_to_comfort():
    way = pieces(1.0, -144.0, 13.0, [(16.0, 1.0), (16.0, 8.0), (20.0, 2.0)])
    assert way[2, 1] < 0.0
    assert alone(way, 12.0) == TOO_HARD


def test_braking_on_the_acceleration_lane_keeps_to_comfort():
    way = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (13.0, 1.0), (20.0, 2.0)])
    assert alone(way, 13.0) == TOO_HARD


def test_merged_vehicle_keeps_to_comfort():
    way = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (17.0, 1.0), (20.0, 1.0)])
    assert alone(way, 12.0) == ACCEPTED
    assert alone(way, 11.0) == TOO_HARD


def test_undecided_vehicle_keeps_to_comfort():
    way = pieces(1.0, -144.0, 13.0, [(16.0, 1.0), (0.0, 8.0)])
    assert alone(way, UNDECIDED) == TOO_HARD


# distances ----------------------------------------------------------------------------------


def _on_road(x_gap_m=10.0, y_gap_m=8.0):
    """X and Y such that these gaps lie before and behind R at its merge."""
    return [
        (pieces(0.0, -199.0 + x_gap_m, 20.0), STREAM),
        (pieces(0.0, -209.0 - y_gap_m, 20.0), STREAM),
        *ROAD[2:],
    ]


@pytest.mark.parametrize(("margin_m", "code"), [(0.1, ACCEPTED), (0.0999, TOO_NEAR_AT_MERGE)])
def test_eq_15_and_16_hold_with_the_allowance_at_the_lane_change(margin_m, code):
    in_front = verdict(New(R, MERGE, 12.0), vehicles=_on_road(x_gap_m=L_R + margin_m))
    behind = verdict(New(R, MERGE, 12.0), vehicles=_on_road(y_gap_m=L_R + margin_m))
    assert (in_front.code, behind.code) == (code, code)
    assert in_front.least_margin_m == close(margin_m)
    assert behind.least_margin_m == close(margin_m)
    if code != ACCEPTED:
        assert (in_front.row, in_front.other_row) == (R, X)
        assert (behind.row, behind.other_row) == (R, Y)


def test_lane_change_counts_each_leader_s_own_length():
    long_x = [(*_on_road()[0], 15.0), *_on_road()[1:]]
    assert verdict(New(R, MERGE, 12.0), vehicles=long_x).code == TOO_NEAR_AT_MERGE
    long_y = [_on_road()[0], (*_on_road()[1], 15.0), *_on_road()[2:]]
    assert verdict(New(R, MERGE, 12.0), vehicles=long_y).code == ACCEPTED
    long_r = [*_on_road()[:2], (R_WAY, UNDECIDED, 12.5), ROAD[3]]
    assert verdict(New(R, MERGE, 12.0), vehicles=long_r).code == TOO_NEAR_AT_MERGE


def test_lane_change_of_another_is_kept_free_too():
    # R's merge is committed, X (7 m long) ahead of it moves back to 0.8 m in front of it, for which
    # Eq. 1 asks no more than 0.14 m
    road = [(X_WAY, STREAM, 7.0), (Y_WAY, STREAM, 9.0), (MERGE, 12.0), ROAD[3]]
    back = aside(X_WAY, 1.0, 2.0, 9.5, -7.2)
    found = verdict(New(X, back, STREAM, 1), vehicles=road)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR_AT_MERGE, X, R)
    assert found.least_margin_m == close(0.8 - L_R)
    # Y behind it comes as near, while the merge is proposed together with that
    road[R] = ROAD[R]
    ahead = aside(Y_WAY, 1.0, 2.0, 9.5, 7.2)
    found = verdict(New(Y, ahead, STREAM, 1), New(R, MERGE, 12.0), vehicles=road)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR_AT_MERGE, Y, R)
    assert found.least_margin_m == close(0.8 - L_R)


@pytest.mark.parametrize("second_s", [12.0, 12.5, 13.0])
def test_two_that_merge_one_after_the_other_keep_eq_15_at_the_second_merge(second_s):
    # R leads by 5.5 m on the ramp all along; both at 20 m/s from 12.34 s on
    q_way = pieces(0.0, -165.5, 16.0, [(16.0, 10.0), (20.0, 2.0)])
    road = [*ROAD[:2], ROAD[2], (q_way, second_s)]
    found = verdict(New(R, MERGE, 12.0), vehicles=road)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR_AT_MERGE, R, 3)
    at_s = np.array([second_s])
    gap_m = sampled(MERGE, at_s)[0][0] - 5.0 - sampled(q_way, at_s)[0][0]
    assert found.least_margin_m == close(gap_m - L_R)


def test_lane_change_that_is_over_is_not_asked_again():
    # R has merged 0.5 m behind X, for which Eq. 1 asks 0.14 m
    merged = [(pieces(0.0, 105.5, 20.0), STREAM), (pieces(0.0, 100.0, 20.0), 0.5)]
    slower = pieces(1.0, 120.0, 20.0, [(19.0, 2.0), (20.0, 2.0)])
    found = verdict(New(1, slower, 0.5), vehicles=merged)
    assert found.code == ACCEPTED
    assert found.least_margin_m == close(0.5 - CRUISE)


@pytest.mark.parametrize(("margin_m", "code"), [(0.1, ACCEPTED), (0.0999, TOO_NEAR)])
def test_eq_1_holds_on_the_ramp_with_the_allowance(margin_m, code):
    # R is to stop as committed; another is ahead of it, or behind
    stop = np.array([[1.0, -144.0, 16.0, 0.0], *R_WAY[1:]])
    # at a stand 0.04 m are asked; on the way 3e-9 * 32 m more, and it is as near then
    distance_m = 5.0 + 0.04 + 9.6e-8 + margin_m
    for side in (1.0, -1.0):
        other = R_WAY + np.array([0.0, side * distance_m, 0.0, 0.0])
        found = verdict(New(1, stop, UNDECIDED), vehicles=[(other, UNDECIDED), ROAD[2]])
        assert found.code == code
        assert found.least_margin_m == close(margin_m)


def test_ramp_vehicle_must_not_run_into_one_that_merges_later():
    # R accelerates from the nose, the one ahead waits until 11 s to do so
    ahead = pieces(0.0, -154.5, 16.0, [(16.0, 11.0), (20.0, 2.0)])
    road = [ROAD[0], ROAD[1], ROAD[2], (ahead, 13.0)]
    found = verdict(New(R, MERGE, 12.0), vehicles=road)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR, R, 3)
    # the same where the other one is changed
    road = [ROAD[0], ROAD[1], (MERGE, 12.0), (ahead, 13.0)]
    again = pieces(1.0, -138.5, 16.0, [(16.0, 10.0), (20.0, 2.0)])
    found = verdict(New(3, again, 13.0), vehicles=road)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR, 3, R)


def test_vehicle_on_the_acceleration_lane_may_pass_one_that_has_merged():
    # P leaves the lane at 11 s and brakes on the mainline; R passes it and merges far ahead
    p_way = pieces(0.0, -145.5, 15.5, [(15.5, 11.0), (5.0, 2.0)])
    r_way = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (20.0, 4.0)])
    road = [(p_way, 11.0), (R_WAY, UNDECIDED)]
    assert verdict(New(1, r_way, 14.0), vehicles=road).code == ACCEPTED
    # beside it there is no lane change, and none before it while it is behind on the same lane
    assert verdict(New(1, r_way, 13.0), vehicles=road).code == TOO_NEAR_AT_MERGE
    road = [(p_way, 13.5), (R_WAY, UNDECIDED)]
    assert verdict(New(1, r_way, 14.0), vehicles=road).code == TOO_NEAR
    # the same where R is committed and P is to leave the lane at 11 s, or at 14 s
    braking = pieces(1.0, -130.0, 15.5, [(15.5, 10.0), (5.0, 3.75)])
    road = [(p_way, UNDECIDED), (r_way, 15.0)]
    assert verdict(New(0, braking, 11.0), vehicles=road).code == ACCEPTED
    assert verdict(New(0, braking, 14.0), vehicles=road).code == TOO_NEAR


def test_least_margin_on_the_ramp_counts_where_it_is_the_least():
    # one second behind R: 11 m between bumpers on the ramp, 15 m when it merges
    second = pieces(0.0, -176.0, 16.0, [(16.0, 11.0), (20.0, 2.0)])
    road = [(second, 13.0), (R_WAY, UNDECIDED)]
    found = verdict(New(1, MERGE, 12.0), vehicles=road)
    assert found.code == ACCEPTED
    assert found.least_margin_m == close(10.96 - 9.6e-8)


@pytest.mark.parametrize(("margin_m", "code"), [(0.1, ACCEPTED), (0.0999, TOO_NEAR)])
def test_eq_1_holds_on_the_mainline_with_the_allowance(margin_m, code):
    # Y closes up to X by 5 m, and X falls back onto Y as much
    distance_m = 5.0 + CRUISE + margin_m
    road = [(X_WAY, STREAM), (X_WAY - np.array([0.0, 5.0 + distance_m, 0.0, 0.0]), STREAM)]
    back = aside(X_WAY, 1.0, 1.0, 10.0, -5.0)
    found = verdict(New(0, back, STREAM, 1), vehicles=road)
    assert found.code == code
    assert found.least_margin_m == close(margin_m)
    road = [*road, (pieces(0.0, -400.0, 16.0), UNDECIDED)]
    merges_far_off = New(2, pieces(1.0, -384.0, 16.0, [(16.0, 24.0), (20.0, 2.0)]), 27.0)
    ahead = aside(road[1][0], 1.0, 1.0, 10.0, 5.0)
    found = verdict(New(1, ahead, STREAM, 1), merges_far_off, vehicles=road)
    assert found.code == code
    assert found.least_margin_m == close(margin_m)


def test_eq_1_holds_after_the_merge_up_to_the_end_of_the_zone():
    # after its merge R slows down by 1 m/s within 2 s; Y, 8 m behind, gains a metre a second
    slower = pieces(1.0, -144.0, 16.0, [(16.0, 9.0), (20.0, 2.0), (19.0, 2.0)])
    found = verdict(New(R, slower, 12.0))
    assert (found.code, found.row, found.other_row) == (TOO_NEAR, R, Y)
    # R leaves the zone when it has driven 325 m more: 7 m less then; 18 m behind Y is far enough
    left_s = 325.0 / 19.0
    least_m = 18.0 - 1.0 - left_s - 0.04 - 3e-9 * 39.0 - 12.96 / 129.54
    found = verdict(New(R, slower, 12.0), vehicles=_on_road(y_gap_m=18.4))
    assert found.code == ACCEPTED
    assert found.least_margin_m == close(least_m + 0.4)


def test_speed_difference_counts_while_it_lasts():
    # Y closes in by 2 m with up to 1 m/s: nearest at the end, where speeds are equal
    ahead = aside(Y_WAY, 1.0, 1.0, 4.0, 2.0)
    road = [(Y_WAY + np.array([0.0, 8.0, 0.0, 0.0]), STREAM), (Y_WAY, STREAM), *ROAD[2:]]
    far = pieces(0.0, -400.0, 16.0)
    merge = New(2, pieces(1.0, -384.0, 16.0, [(16.0, 24.0), (20.0, 2.0)]), 27.0)
    road = [*road[:2], (far, UNDECIDED)]
    found = verdict(New(1, ahead, STREAM, 1), merge, vehicles=road)
    assert found.code == ACCEPTED
    assert found.least_margin_m == close(1.0 - CRUISE)


# who is compared with whom ------------------------------------------------------------------


def test_two_changes_are_examined_together():
    # either alone leaves 5 m or more, both together 1 m less than nothing
    road = [(X_WAY, STREAM), (X_WAY - np.array([0.0, 15.0, 0.0, 0.0]), STREAM)]
    back = New(0, aside(X_WAY, 1.0, 1.0, 10.0, -5.5), STREAM, 1)
    way = road[1][0]
    ahead = aside(way, 1.0, 1.0, 10.0, 5.5)
    fast = BOUNDS._replace(mainline_speed_mps=22.0)  # no matter who may be how fast
    both = (back, New(1, ahead, STREAM, 1))
    assert verdict(both[0], vehicles=road, bounds=fast).code == ACCEPTED
    assert verdict(both[1], vehicles=road, bounds=fast).code == ACCEPTED
    found = verdict(*both, vehicles=road, bounds=fast)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR, 0, 1)
    assert found.least_margin_m == close(10.0 - 11.0 - CRUISE)
    found = verdict(*both[::-1], vehicles=road, bounds=fast)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR, 1, 0)


def test_two_changes_are_not_examined_against_what_the_other_has_left():
    # X goes 6 m ahead and Y 4 m after it: against X as committed Y would be too near
    road = [(X_WAY, STREAM), (X_WAY - np.array([0.0, 8.0, 0.0, 0.0]), STREAM)]
    fast = BOUNDS._replace(mainline_speed_mps=22.0)
    ahead = New(0, aside(X_WAY, 1.0, 1.0, 10.0, 6.0), STREAM, 1)
    after = New(1, aside(road[1][0], 1.0, 1.0, 10.0, 4.0), STREAM, 1)
    assert verdict(after, vehicles=road, bounds=fast).code == TOO_NEAR
    for order in ((ahead, after), (after, ahead)):
        found = verdict(*order, vehicles=road, bounds=fast)
        assert found.code == ACCEPTED
        assert found.least_margin_m == close(3.0 - CRUISE)


def test_vehicles_that_have_left_do_not_count_and_entering_ones_do():
    road = [(X_WAY, STREAM), (X_WAY - np.array([0.0, 5.1, 0.0, 0.0]), STREAM)]
    as_before = pieces(1.0, -169.0, 20.0)
    assert verdict(New(0, as_before, STREAM), vehicles=road).code == TOO_NEAR
    assert verdict(New(0, as_before, STREAM), vehicles=road, live=[0]).code == ACCEPTED
    # one that enters is not live yet: it is compared with those that are
    found = verdict(New(0, as_before, STREAM), vehicles=road, live=[1])
    assert (found.code, found.row, found.other_row) == (TOO_NEAR, 0, 1)


@pytest.mark.parametrize("live", [[], [0], [1], [0, 1]])
def test_two_changes_are_examined_together_live_or_not(live):
    road = [(X_WAY, STREAM), (X_WAY - np.array([0.0, 5.1, 0.0, 0.0]), STREAM)]
    new = New(0, pieces(1.0, -169.0, 20.0), STREAM), New(1, pieces(1.0, -174.1, 20.0), STREAM)
    found = verdict(*new, vehicles=road, live=live)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR, 0, 1)
    assert found.least_margin_m == close(0.1 - CRUISE)


def test_least_margin_is_that_of_the_nearest_pair():
    # four vehicles enter at once, 9, 10 and 12 m between bumpers; a fifth is 50 m behind
    stations_m = [100.0, 86.0, 71.0, 54.0, -1.0]
    road = [(pieces(1.0, station_m, 20.0), STREAM) for station_m in stations_m]
    new = [New(row, way, STREAM) for row, (way, _) in enumerate(road[:4])]
    found = verdict(*new, vehicles=road, live=[4])
    assert found.code == ACCEPTED
    assert found.least_margin_m == close(9.0 - CRUISE)
    found = verdict(new[3], vehicles=road, live=[4])
    assert found.least_margin_m == close(50.0 - CRUISE)


def test_vehicle_alone_on_the_road_has_all_the_room_there_is():
    found = verdict(New(0, pieces(1.0, -169.0, 20.0), STREAM), vehicles=ROAD[:1])
    assert (found.code, found.least_margin_m) == (ACCEPTED, math.inf)


def _busy_traffic(rng):
    """Eight vehicles over 700 m: on the mainline, merging sooner or later, or not at all."""
    road = []
    for _ in range(8):
        speeds_mps, durations_s = rng.uniform(16.0, 22.0, 2), rng.uniform(1.0, 4.0, 2)
        stretches = [(speeds_mps[1], durations_s[0]), (20.0, durations_s[1])]
        way = pieces(0.0, rng.uniform(-500.0, 200.0), speeds_mps[0], stretches)
        merge_s = rng.choice([STREAM, STREAM, STREAM, 0.5, rng.uniform(1.5, 12.0), UNDECIDED])
        road.append((way, merge_s, rng.uniform(4.0, 16.0)))
    return road


def test_pairs_that_are_skipped_for_being_far_apart_change_no_verdict():
    # with a single other vehicle on the road nothing is skipped
    rng = np.random.default_rng(8)
    accepted = 0
    for k in range(400):
        road = _busy_traffic(rng)
        if k % 2 == 0:
            slow_mps = rng.uniform(17.0, 20.0)
            way = pieces(1.0, rng.uniform(-400.0, 100.0), 20.0, [(slow_mps, 2.0), (20.0, 2.0)])
            new, road[0] = New(0, way, STREAM), (way, STREAM, 5.0)
        else:
            new, road[0] = New(0, MERGE, 12.0), (R_WAY, UNDECIDED, 5.0)
        singly = [verdict(new, vehicles=road, live=[other]) for other in range(1, 8)]
        found = verdict(new, vehicles=road)
        unsafe = {one.other_row: one for one in singly if one.code != ACCEPTED}
        if unsafe:
            assert found == unsafe[found.other_row]
        else:
            assert found.code == ACCEPTED
            assert found.least_margin_m == min(one.least_margin_m for one in singly)
            accepted += 1
    assert 50 < accepted < 350


def _apart(mine, theirs, least):
    return surely_apart(mine, envelope_on_mainline(mine, BOUNDS), theirs, 1.0, least, BOUNDS)


def test_pair_is_only_skipped_if_its_margin_is_not_the_least():
    rng = np.random.default_rng(9)
    skipped = 0
    for _ in range(200):
        ways = [
            way_with(way, merge_s, sized(length_m)) for way, merge_s, length_m in _busy_traffic(rng)
        ]
        for mine, theirs in zip(ways[::2], ways[1::2], strict=True):
            code, margin_m = examine_pair(mine, theirs, 1.0, BOUNDS)
            if code != ACCEPTED:
                assert not _apart(mine, theirs, -math.inf)
            elif margin_m < math.inf:
                assert not _apart(mine, theirs, margin_m + 1e-9)
                # the envelopes give away some metres, not tens of them
                skipped += _apart(mine, theirs, margin_m - 30.0)
    assert skipped > 100


def test_pair_that_never_meets_on_the_mainline_is_skipped_and_one_on_the_ramp_is_not():
    undecided, other = _way(R_WAY, UNDECIDED), _way(Q_WAY, UNDECIDED)
    assert _apart(undecided, _way(X_WAY, STREAM), math.inf)
    assert not _apart(undecided, other, -math.inf)
    assert not _apart(_way(MERGE, 12.0), other, -math.inf)
