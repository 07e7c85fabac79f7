import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.metrics.margins import least_margin_m
from coramp.metrics.safety_figures import safety_figures
from coramp.metrics.separations import closing_extremes
from coramp.vehicles.separation import smallest_margin_m
from tests.mathematics import SAFETY, random_pairs
from tests.metrics import NEVER, PAPER, Car, outcome_of

FRICTION = 254.0 * (0.4 + 0.11)


def eq_1(front_mps, rear_mps):
    closing_km_h = 3.6 * max(0.0, rear_mps - front_mps)
    return 2.0 * 0.02 + 3e-9 * (front_mps + rear_mps) + closing_km_h**2 / FRICTION


def eq_15(merging_mps, other_mps):
    along = merging_mps * math.cos(math.radians(30.0))
    return 2.0 * 0.02 + (3.6 * (along - other_mps)) ** 2 / FRICTION


def steady(name, station, speed, exit_s, **rest):
    return Car(name, ((0.0, station, speed, 0.0),), exit_s=exit_s, **rest)


def figures(*cars, end_s=100.0, **rest):
    return safety_figures(outcome_of(cars, end_s=end_s, **rest), PAPER)


def test_a_faster_follower_has_a_margin_a_ttc_and_a_drac():
    # 45 m apart, closing with 10 m/s for 2 s: 25 m are left
    found = figures(steady("m1", 100.0, 10.0, 2.0), steady("m2", 50.0, 20.0, 2.0))
    assert found["min_ttc_s"] == pytest.approx(25.0 / 10.0)
    assert found["max_drac_mps2"] == pytest.approx(10.0**2 / (2.0 * 25.0))
    assert found["min_margin_m"] == pytest.approx(25.0 - eq_1(10.0, 20.0))
    assert found["safety_violations"] == 0
    assert found["max_severity"] == 0.0


def test_a_slower_follower_has_a_margin_alone():
    found = figures(steady("m1", 100.0, 20.0, 5.0), steady("m2", 94.5, 20.0, 5.0))
    assert found["min_margin_m"] == pytest.approx(0.5 - eq_1(20.0, 20.0))
    assert (found["min_ttc_s"], found["max_drac_mps2"]) == (None, 0.0)


@pytest.mark.parametrize(("short_m", "counted"), [(1e-12, 0), (1e-9, 0), (1e-6, 1), (1e-3, 1)])
def test_rounding_is_no_violation_and_a_thousandth_of_a_millimetre_is(short_m, counted):
    rear_m = 95.0 - eq_1(20.0, 20.0) + short_m
    found = figures(steady("m1", 100.0, 20.0, 5.0), steady("m2", rear_m, 20.0, 5.0))
    assert found["min_margin_m"] == pytest.approx(-short_m, abs=1e-10)
    assert found["safety_violations"] == counted


@pytest.mark.parametrize(("short_m", "counted"), [(1e-9, 0), (1e-6, 1)])
def test_rounding_is_no_violation_at_a_lane_change_either(short_m, counted):
    ahead_m = 100.0 + 5.0 + eq_15(19.0, 20.0) - short_m
    found = figures(
        steady("m1", ahead_m - 20.0, 20.0, 1.5),
        steady("r1", 100.0 - 19.0, 19.0, 1.5, merge_s=1.0),
    )
    assert found["safety_violations"] == counted


def test_the_order_of_vehicles_in_the_records_does_not_matter():
    cars = [
        steady("m1", 100.0, 10.0, 2.0),
        steady("m2", 50.0, 20.0, 3.0),
        steady("m3", 20.0, 22.0, 1.0),
    ]
    assert figures(*cars) == figures(*reversed(cars))


def test_who_overtakes_on_the_acceleration_lane_is_no_neighbour_meanwhile():
    """SUMO's drivers do so where the mainline stands: 3 m behind one, beside it, 1 m before it."""
    cars = [
        steady("m1", 100.0, 0.0, 20.0),
        Car("m2", ((0.0, 90.0, 2.0, 0.0), (1.0, 92.0, 2.0, 0.0), (8.0, 106.0, 2.0, 0.0))),
    ]
    found = figures(*cars, end_s=12.0, lane=np.array([2, 2, 0, 2]))
    assert found["safety_violations"] == 0
    assert found["min_margin_m"] == pytest.approx(106.0 - 5.0 - 100.0 - eq_1(2.0, 0.0))
    assert found["min_ttc_s"] == pytest.approx(3.0 / 2.0)


def test_too_near_is_one_violation_however_long_it_lasts():
    found = figures(steady("m1", 100.0, 10.0, 4.0), steady("m2", 50.0, 20.0, 4.0))
    assert found["min_margin_m"] == pytest.approx(5.0 - eq_1(10.0, 20.0))
    assert found["safety_violations"] == 1


def test_every_pair_of_neighbours_is_a_violation_of_its_own():
    near = 5.0 + 0.5 * eq_1(20.0, 20.0)
    cars = [steady(f"m{k}", 200.0 - near * k, 20.0, 5.0) for k in range(4)]
    assert figures(*cars)["safety_violations"] == 3


def test_vehicles_are_neighbours_only_while_both_are_there():
    ahead = steady("m1", 100.0, 10.0, exit_s=2.0)
    behind = Car("m2", ((0.0, 50.0, 20.0, 0.0),), exit_s=9.0)
    assert figures(ahead, behind)["safety_violations"] == 0
    late = Car("m2", ((3.0, 50.0, 20.0, 0.0),), scheduled_s=3.0, entry_s=3.0, exit_s=9.0)
    found = figures(ahead, late)
    assert (found["min_margin_m"], found["min_ttc_s"]) == (None, None)


def test_who_is_still_there_at_the_end_counts_up_to_it():
    cars = (steady("m1", 100.0, 10.0, NEVER), steady("m2", 50.0, 20.0, NEVER))
    assert figures(*cars, end_s=2.0)["min_ttc_s"] == pytest.approx(2.5)
    assert figures(*cars, end_s=3.0)["min_ttc_s"] == pytest.approx(1.5)


def test_who_never_entered_meets_nobody():
    cars = (steady("m1", 100.0, 10.0, 2.0), Car("m2", entry_s=NEVER, scheduled_s=1.0))
    assert figures(*cars)["min_margin_m"] is None


def test_a_vehicles_own_length_counts():
    for length_m, gap_m in ((5.0, 25.0), (15.0, 15.0)):
        front = steady("m1", 100.0, 10.0, 2.0, length_m=length_m)
        found = figures(front, steady("m2", 50.0, 20.0, 2.0, length_m=30.0))
        assert found["min_ttc_s"] == pytest.approx(gap_m / 10.0)


def test_the_ramp_is_a_lane_of_its_own_until_the_merge():
    side_by_side = (
        steady("m1", -100.0, 16.0, 10.0),
        Car("r1", ((0.0, -100.0, 16.0, 0.0),), exit_s=10.0, merge_s=NEVER),
    )
    found = figures(*side_by_side)
    assert (found["min_margin_m"], found["safety_violations"]) == (None, 0)


def test_vehicles_on_the_ramp_must_keep_their_distance_too():
    near = 5.0 + 0.5 * eq_1(16.0, 16.0)
    cars = [Car(f"r{k}", ((0.0, -100.0 - near * k, 16.0, 0.0),), exit_s=5.0) for k in range(2)]
    found = figures(*cars)
    assert found["safety_violations"] == 1
    assert found["min_margin_m"] == pytest.approx(-0.5 * eq_1(16.0, 16.0))


def merging(name, station, speed, merge_s, exit_s):
    return Car(name, ((0.0, station, speed, 0.0),), exit_s=exit_s, merge_s=merge_s)


def test_severity_is_that_of_equations_5_8_and_9_at_the_lane_change():
    # 10 m behind the front vehicle, bumper to bumper, 40 m ahead of the rear one
    found = figures(
        steady("m1", 115.0, 20.0, 10.0),
        merging("r1", 100.0, 20.0, 2.0, 10.0),
        steady("m2", 55.0, 20.0, 10.0),
    )
    along = 20.0 * math.cos(math.radians(30.0))
    collision = 5.0 * (20.0 - along) / 2.0
    urgent = (20.0**2 - along**2) / (2.0 * 10.0)
    assert found["max_severity"] == pytest.approx(collision * urgent)
    assert found["safety_violations"] == 0
    assert found["min_margin_m"] == pytest.approx(10.0 - eq_1(20.0, 20.0))


@pytest.mark.parametrize("behind", [True, False])
@pytest.mark.parametrize(("slack_m", "violations"), [(0.01, 0), (-0.01, 1)])
def test_a_merge_nearer_than_eq_15_or_16_is_a_violation(behind, slack_m, violations):
    distance_m = eq_15(20.0, 20.0) + slack_m
    assert distance_m > eq_1(20.0, 20.0)
    place_m = 100.0 - 5.0 - distance_m if behind else 100.0 + 5.0 + distance_m
    found = figures(
        steady("m1", 100.0, 20.0, 10.0),
        merging("r1", place_m, 20.0, 2.0, 10.0),
    )
    assert found["safety_violations"] == violations


def test_a_merging_vehicle_parts_the_pair_it_merges_into():
    # before: m2 closes in on m1; from 2 s on r1 is between them
    found = figures(
        steady("m1", 200.0, 10.0, 6.0),
        merging("r1", 150.0, 10.0, 2.0, 6.0),
        steady("m2", 60.0, 20.0, 6.0),
    )
    assert found["min_ttc_s"] == pytest.approx((150.0 + 60.0 - 5.0 - 60.0 - 120.0) / 10.0)


def test_pairs_that_meet_again_count_again():
    near = 5.0 + 0.5 * eq_1(20.0, 20.0)
    ahead, behind = steady("m1", 100.0, 20.0, 9.0), steady("m2", 100.0 - near, 20.0, 9.0)
    assert figures(ahead, behind)["safety_violations"] == 1
    # m3 appears between the two for 2 s: m1 and m2 before and after, and each of them with m3
    third = Car("m3", ((1.0, 118.0, 20.0, 0.0),), scheduled_s=1.0, entry_s=1.0, exit_s=3.0)
    assert figures(ahead, behind, third)["safety_violations"] == 4


def test_collisions_braking_and_plan_errors_are_passed_on():
    car = Car(
        "m1", ((0.0, 0.0, 20.0, -3.5), (1.0, 18.25, 16.5, 2.0)), exit_s=5.0, plan_error_m=0.02
    )
    found = figures(car, collisions=4)
    assert (found["collisions"], found["max_decel_mps2"], found["plan_error_m"]) == (4, 3.5, 0.02)


speeds = st.floats(0.0, 30.0)
accels = st.floats(-3.0, 3.0)


def two_pieces(station, speed, accel, duration):
    accel = max(accel, -speed / duration)
    end_m = station + speed * duration + 0.5 * accel * duration**2
    return np.array(
        [[0.0, station, speed, accel], [duration, end_m, speed + accel * duration, 0.0]]
    )


def state(pieces, times):
    row = pieces[np.searchsorted(pieces[:, 0], times, side="right") - 1]
    x = times - row[:, 0]
    return row[:, 1] + row[:, 2] * x + 0.5 * row[:, 3] * x**2, row[:, 2] + row[:, 3] * x


@given(
    speeds, speeds, accels, accels, st.floats(0.5, 5.0), st.floats(0.5, 5.0), st.floats(40.0, 150.0)
)
def test_ttc_and_drac_are_the_exact_extremes(v1, v2, a1, a2, t1, t2, gap):
    front, rear = two_pieces(gap + 5.0, v1, a1, t1), two_pieces(0.0, v2, a2, t2)
    end_s = 6.0
    ttc_s, drac_mps2 = closing_extremes(front, 5.0, rear, 0.0, end_s)
    times = np.unique(np.concatenate([np.linspace(0.0, end_s, 3001), [t1, t2]]))
    times = times[times <= end_s]
    (front_m, front_mps), (rear_m, rear_mps) = state(front, times), state(rear, times)
    gaps, closing = front_m - 5.0 - rear_m, rear_mps - front_mps
    if gaps.min() <= 0.5:
        return  # they collide, or almost: between samples anything may happen
    seen = closing > 1e-9
    sampled_ttc = (gaps[seen] / closing[seen]).min(initial=math.inf)
    sampled_drac = (closing[seen] ** 2 / (2.0 * gaps[seen])).max(initial=0.0)
    assert ttc_s <= sampled_ttc * (1.0 + 1e-9)
    assert drac_mps2 >= sampled_drac * (1.0 - 1e-9)
    if math.isfinite(sampled_ttc) and sampled_ttc < 1e3:
        assert ttc_s == pytest.approx(sampled_ttc, rel=0.01)
        assert drac_mps2 == pytest.approx(sampled_drac, rel=0.01, abs=1e-9)


def test_planners_and_figures_read_the_safe_distance_alike():
    for front, rear, start_s, lasts_s in random_pairs(7, 200):
        ours_m, when_s = least_margin_m(front, 5.0, rear, start_s, start_s + lasts_s, SAFETY)
        theirs_m, _ = smallest_margin_m(front, 5.0, rear, start_s, start_s + lasts_s, SAFETY)
        assert ours_m == pytest.approx(theirs_m, abs=1e-9)
        assert start_s <= when_s <= start_s + lasts_s


@pytest.mark.parametrize("too_near_m", [1e-7, 0.002, 0.5])
def test_every_violation_counts_and_shows_in_the_margin(too_near_m):
    gap_m = eq_1(20.0, 20.0) - too_near_m
    found = figures(steady("m1", 100.0, 20.0, 5.0), steady("m2", 95.0 - gap_m, 20.0, 5.0))
    assert found["safety_violations"] == 1
    assert found["min_margin_m"] == pytest.approx(-too_near_m, abs=1e-9)
    assert found["min_margin_equation"] == 1


@pytest.mark.parametrize(("ahead_m", "equation"), [(5.5, 15), (-5.5, 16)])
def test_a_lane_change_that_is_too_near_shows_in_the_margin_with_its_equation(ahead_m, equation):
    # 0.5 m between bumpers at 20 m/s each: Eq. 1 asks for 0.04 m, Eq. 15 and 16 for 0.76 m
    merging = Car("r1", ((0.0, -50.0, 20.0, 0.0),), merge_s=5.0, exit_s=9.0)
    found = figures(steady("m1", -50.0 + ahead_m, 20.0, 9.0), merging)
    assert found["safety_violations"] == 1
    assert found["min_margin_m"] == pytest.approx(0.5 - eq_15(20.0, 20.0))
    assert found["min_merge_margin_m"] == found["min_margin_m"]
    assert found["min_margin_equation"] == equation


def test_without_a_violation_the_margin_is_over_eq_1():
    found = figures(steady("m1", 100.0, 20.0, 5.0), steady("m2", 80.0, 20.0, 5.0))
    assert found["safety_violations"] == 0
    assert found["min_margin_equation"] == 1
    assert found["min_merge_margin_m"] is None


def test_the_smallest_ttc_may_lie_within_a_piece():
    # gap 10 - 5 x + x^2, closing speed 5 - 2 x: 2 s at both ends, least where c^2 = 2 g,
    # at x = (10 - sqrt(60)) / 4, and there TTC = c / 2
    front = np.array([[0.0, 15.0, 20.0, 0.0]])
    rear = np.array([[0.0, 0.0, 25.0, -2.0], [1.0, 24.0, 23.0, 0.0]])
    ttc_s, _ = closing_extremes(front, 5.0, rear, 0.0, 1.0)
    at_s = (10.0 - math.sqrt(60.0)) / 4.0
    assert ttc_s == pytest.approx((5.0 - 2.0 * at_s) / 2.0)
    assert ttc_s < 1.94
