import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.kinematics.trajectory import build
from coramp.metrics.motion import (
    binned_motion,
    distance_of_each_m,
    fuel_of_each_l,
    hard_brakings,
    hardest_braking_mps2,
    largest_jerk_mps3,
    pieces_of_samples,
    stopped_vehicles,
)

CRUISE = (0.1569, 0.0245, -7.415e-4, 5.975e-5)  # Table 3, ml/s
GAIN = (0.07224, 0.09681, 1.075e-3)


def rate_mlps(speed, accel):
    powers = [speed**k for k in range(4)]
    cruise = sum(c * p for c, p in zip(CRUISE, powers, strict=True))
    return cruise + max(accel, 0.0) * sum(g * p for g, p in zip(GAIN, powers[:3], strict=True))


def fuel_l(speed, accel, duration):
    """Simpson's rule, which is exact for polynomials of third degree."""
    ends = rate_mlps(speed, accel) + rate_mlps(speed + accel * duration, accel)
    middle = rate_mlps(speed + accel * duration / 2.0, accel)
    return duration / 6.0 * (ends + 4.0 * middle) / 1000.0


def one(*rows):
    return np.array([0, len(rows)]), np.array(rows, dtype=float)


def fuel(pieces, until):
    first, rows = pieces
    car = np.zeros(1, np.int64), np.array([1500.0])
    return fuel_of_each_l(first, rows, np.array([float(until)]), *car)[0]


def test_a_cruise_burns_what_the_table_says():
    # 0.1569 + 0.49 - 0.2966 + 0.478 ml/s at 20 m/s
    assert fuel(one((0.0, 0.0, 20.0, 0.0)), 100.0) == pytest.approx(0.08283, abs=1e-5)
    assert fuel(one((5.0, 0.0, 0.0, 0.0)), 1005.0) == pytest.approx(0.1569)


def test_accelerating_costs_more_and_braking_no_less_than_rolling():
    up, down = one((0.0, 0.0, 10.0, 1.5)), one((0.0, 0.0, 16.0, -1.5))
    assert fuel(up, 4.0) == pytest.approx(fuel_l(10.0, 1.5, 4.0))
    # the same speeds the other way round, without the term of acceleration
    extra = fuel(up, 4.0) - fuel(down, 4.0)
    times = np.linspace(0.0, 4.0, 4001)
    speeds = 10.0 + 1.5 * times
    gain = 1.5 * (GAIN[0] + GAIN[1] * speeds + GAIN[2] * speeds**2)
    assert extra == pytest.approx(np.trapezoid(gain, times) / 1000.0, rel=1e-6)


@given(st.floats(0.0, 30.0), st.floats(-4.0, 6.0), st.floats(0.01, 60.0))
def test_fuel_is_exact_over_a_piece(speed, accel, duration):
    duration = min(duration, speed / -accel) if accel < 0.0 else duration
    pieces = one((3.0, 0.0, speed, accel))
    assert fuel(pieces, 3.0 + duration) == pytest.approx(fuel_l(speed, accel, duration), abs=1e-12)


@given(st.floats(0.1, 19.9))
def test_fuel_of_two_parts_is_fuel_of_the_whole(cut):
    pieces = one((0.0, 0.0, 10.0, 1.0), (8.0, 112.0, 18.0, -0.5))
    whole = fuel_l(10.0, 1.0, 8.0) + fuel_l(18.0, -0.5, 12.0)
    assert fuel(pieces, 20.0) == pytest.approx(whole)
    before = (
        fuel_l(10.0, 1.0, cut)
        if cut < 8.0
        else fuel_l(10.0, 1.0, 8.0) + fuel_l(18.0, -0.5, cut - 8.0)
    )
    assert fuel(pieces, cut) == pytest.approx(before)


def test_fuel_and_distance_are_each_vehicles_own():
    first = np.array([0, 2, 2, 3])
    rows = np.array([[0.0, 0.0, 10.0, 2.0], [5.0, 75.0, 20.0, 0.0], [1.0, 50.0, 15.0, -1.0]])
    until = np.array([7.0, 9.0, 4.0])
    np.testing.assert_allclose(
        fuel_of_each_l(first, rows, until, np.zeros(len(until), np.int64), np.ones(len(until))),
        [fuel_l(10.0, 2.0, 5.0) + fuel_l(20.0, 0.0, 2.0), 0.0, fuel_l(15.0, -1.0, 3.0)],
    )
    np.testing.assert_allclose(
        distance_of_each_m(first, rows, until), [75.0 + 40.0, 0.0, 45.0 - 4.5]
    )


def test_bins_take_the_share_of_time_that_each_vehicle_spends_in_them():
    # m: 10 m/s from 0.5 s to 2.5 s; m: 20 m/s from 1 s to 2 s; r: 8 m/s, 2 m/s2 from 0 s to 2 s
    first = np.array([0, 1, 2, 3])
    rows = np.array([[0.5, 0.0, 10.0, 0.0], [1.0, 0.0, 20.0, 0.0], [0.0, 0.0, 8.0, 2.0]])
    until = np.array([2.5, 2.0, 2.0])
    on_ramp = np.array([False, False, True])
    distance, time, vehicles = binned_motion(first, rows, until, on_ramp, 4)
    np.testing.assert_allclose(distance, [[5.0, 30.0, 5.0, 0.0], [9.0, 11.0, 0.0, 0.0]])
    np.testing.assert_allclose(time, [[0.5, 2.0, 0.5, 0.0], [1.0, 1.0, 0.0, 0.0]])
    np.testing.assert_array_equal(vehicles, [[1, 2, 1, 0], [1, 1, 0, 0]])


def test_a_vehicle_with_several_pieces_in_a_bin_counts_once():
    first, rows = one((0.0, 0.0, 10.0, 4.0), (0.25, 0.0, 11.0, -4.0), (0.5, 0.0, 10.0, 0.0))
    distance, time, vehicles = binned_motion(first, rows, np.array([1.0]), np.array([False]), 2)
    assert distance[0, 0] == pytest.approx(10.5 * 0.5 + 10.0 * 0.5)
    assert time[0, 0] == pytest.approx(1.0)
    assert vehicles.tolist() == [[1, 0], [0, 0]]


pieces_of_one = st.lists(
    st.tuples(st.floats(0.05, 3.0), st.floats(0.0, 2.0)), min_size=1, max_size=6
)


@given(st.floats(0.0, 5.0), pieces_of_one)
def test_bins_lose_no_distance_and_no_time(start, parts):
    rows, now, speed = [], start, 5.0
    for duration, accel in parts:
        rows.append((now, 0.0, speed, accel))
        now, speed = now + duration, speed + accel * duration
    first, rows = one(*rows)
    until = np.array([now])
    distance, time, _ = binned_motion(first, rows, until, np.array([True]), 40)
    assert distance[1].sum() == pytest.approx(distance_of_each_m(first, rows, until)[0])
    assert time[1].sum() == pytest.approx(now - start)
    assert time[1].max() <= 1.0 + 1e-9
    assert not distance[0].any()


def test_the_hardest_braking_is_the_largest_deceleration():
    _, rows = one((0.0, 0.0, 10.0, 5.0), (1.0, 0.0, 15.0, -2.5), (2.0, 0.0, 12.5, -1.0))
    assert hardest_braking_mps2(rows) == 2.5
    assert hardest_braking_mps2(rows[:1]) == 0.0
    assert hardest_braking_mps2(rows[:0]) == 0.0


def test_samples_become_pieces_in_which_speed_changes_evenly():
    vehicle = np.array([0, 0, 0, 2, 2])
    time = np.array([1.0, 1.1, 1.3, 5.0, 5.1])
    station = np.array([0.0, 1.0, 3.0, 10.0, 10.5])
    speed = np.array([10.0, 10.5, 9.5, 5.0, 5.0])
    first, rows = pieces_of_samples(vehicle, time, station, speed, 3)
    assert first.tolist() == [0, 3, 3, 5]
    np.testing.assert_allclose(rows[:, 3], [5.0, -5.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(rows[:, :3], np.column_stack([time, station, speed]))


def test_no_samples_are_no_pieces():
    none = np.empty(0)
    first, rows = pieces_of_samples(np.empty(0, np.int64), none, none, none, 2)
    assert first.tolist() == [0, 0, 0]
    assert rows.shape == (0, 4)


def test_the_largest_jerk_by_hand():
    # from -2 to +3 m/s2 at 4 s: over 1 s before and after, 5 m/s3; nowhere is it more
    rows = build(0.0, 0.0, 20.0, [(0.0, 2.0), (-2.0, 2.0), (3.0, 2.0), (0.0, 3.0)])
    first = np.array([0, len(rows)])
    assert largest_jerk_mps3(first, rows, np.array([9.0])) == pytest.approx(5.0)
    # one that is over before a second has passed on both sides has none
    assert largest_jerk_mps3(first, rows, np.array([1.5])) == 0.0
    # half a second of braking between cruises: 1 m/s lost within 1 s, whichever second it is
    rows = build(0.0, 0.0, 20.0, [(0.0, 3.0), (-2.0, 0.5), (0.0, 5.0)])
    assert largest_jerk_mps3(np.array([0, len(rows)]), rows, np.array([8.0])) == pytest.approx(1.0)


def test_the_largest_jerk_is_that_of_close_sampling():
    random = np.random.default_rng(3)
    stretches = list(zip(random.normal(size=30), random.uniform(0.1, 2.0, 30), strict=True))
    rows = build(0.0, 0.0, 60.0, stretches)
    end_s = rows[-1, 0]
    t = np.arange(1.0, end_s - 1.0, 0.001)
    before, now, after = (np.interp(t + lag, rows[:, 0], rows[:, 2]) for lag in (-1.0, 0.0, 1.0))
    sampled = np.abs(after - 2.0 * now + before).max()
    found = largest_jerk_mps3(np.array([0, len(rows)]), rows, np.array([end_s]))
    assert found == pytest.approx(sampled, abs=5e-3)
    assert found >= sampled - 1e-9


def braked(harder_than_mps2, *rows, until=100.0):
    first, table = one(*rows)
    return hard_brakings(first, table, np.array([float(until)]), harder_than_mps2)


def test_a_hard_braking_is_one_however_its_deceleration_changes():
    rows = (
        (0.0, 0.0, 30.0, -3.5),
        (0.1, 3.0, 29.6, -4.0),
        (0.15, 4.5, 29.4, -5.0),
        (0.4, 12.0, 28.0, 0.0),
    )
    assert braked(3.0, *rows) == 1
    assert braked(4.5, *rows) == 1  # 0.25 s at -5
    assert braked(5.0, *rows) == 0  # no harder than that


def test_two_hard_brakings_with_a_pause_are_two_and_short_ones_are_none():
    pause = (
        (0.0, 0.0, 30.0, -4.0),
        (0.2, 5.9, 29.2, -2.0),
        (0.3, 8.8, 29.0, -4.0),
        (0.6, 17.3, 27.8, 0.0),
    )
    assert braked(3.0, *pause) == 2
    assert braked(3.0, *pause, until=0.4) == 1  # 0.1 s of the second
    assert braked(3.0, (0.0, 0.0, 30.0, -4.0), (0.19, 5.6, 29.2, 0.0)) == 0


def test_hard_brakings_of_all_vehicles_add_up_and_pieces_of_no_length_part_none():
    rows = np.array(
        [
            (0.0, 0.0, 30.0, -4.0),
            (0.1, 3.0, 29.6, 0.0),
            (0.1, 3.0, 29.6, -4.0),
            (0.3, 8.8, 28.8, 0.0),
            (5.0, 0.0, 20.0, -3.1),
        ]
    )
    assert hard_brakings(np.array([0, 4, 4, 5]), rows, np.array([9.0, 9.0, 6.0]), 3.0) == 2


def stopped(merge_s, *rows, until=100.0, lane_end_m=200.0):
    first, table = one(*rows)
    return stopped_vehicles(first, table, np.array([float(until)]), np.array([merge_s]), lane_end_m)


STAND = ((0.0, -100.0, 20.0, -2.0), (10.0, 0.0, 0.0, 0.0), (12.0, 0.0, 0.0, 2.0))


def test_a_stop_counts_between_entry_and_merge():
    assert stopped(15.0, *STAND) == 1
    assert stopped(10.0, *STAND) == 1
    assert stopped(9.9, *STAND) == 0  # 0.2 m/s then
    assert stopped(np.nan, *STAND) == 1
    assert stopped(np.nan, *STAND, until=9.9) == 0


def test_a_mainline_vehicle_counts_up_to_the_end_of_the_acceleration_lane():
    assert stopped(-np.inf, *STAND) == 1
    assert stopped(-np.inf, *STAND, lane_end_m=0.0) == 1
    assert stopped(-np.inf, *STAND, lane_end_m=-1.0) == 0  # at 2 m/s


def test_stops_count_vehicles_and_not_moments():
    rows = np.array([*STAND, (14.0, 4.0, 4.0, -2.0), (16.0, 8.0, 0.0, 0.0), (0.0, 0.0, 5.0, 0.0)])
    first, until_s, merge_s = np.array([0, 5, 6, 6]), np.full(3, 30.0), np.array([20.0, 9.0, 9.0])
    assert stopped_vehicles(first, rows, until_s, merge_s, 200.0) == 1
