"""What a vehicle can do, by hand, and what of the common rules is left for it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.equations.safe_distance import safe_distance_m, standing_clearance_m
from coramp.vehicles.traits import (
    MASS,
    Traits,
    able_mps2,
    cruise_mps,
    own_rules,
    pair_safety,
    standing_behind_m,
    traits_or_usual,
)
from tests.mathematics import FLAGS, RULES, SAFETY, close, rules_of_numbers, sized, truck

RULES_27 = RULES._replace(road=RULES.road._replace(mainline_speed_mps=27.0))


@pytest.mark.parametrize(
    ("speed_mps", "most_mps2"),
    [(0.0, 1.0), (5.0, 1.0), (5.5, 1.0), (11.0, 0.5), (22.0, 0.25)],  # 5.5 W/kg over the speed
)
def test_a_truck_accelerates_by_its_power_over_its_speed(speed_mps, most_mps2):
    assert able_mps2(truck(), speed_mps) == close(most_mps2)


def test_nothing_but_the_common_limits_binds_a_car():
    assert able_mps2(sized(), 0.0) == able_mps2(sized(), 30.0) == math.inf
    assert cruise_mps(sized(), RULES_27) == 27.0
    assert own_rules(sized(), RULES_27, True) == RULES_27
    assert own_rules(sized(), RULES_27, False) == RULES_27


@pytest.mark.parametrize("flag", [False, True])
def test_own_rules_keep_every_field_that_a_vehicle_does_not_lower(flag):
    rules = rules_of_numbers([flag] * FLAGS)
    silent = np.full(len(Traits._fields), math.nan)
    kept = rules._replace(
        safety=rules.safety._replace(follower_clock_extra_s=0.0),  # of a pair, not of a vehicle
        motion=rules.motion._replace(slowest_ramp_speed_mps=rules.road.ramp_speed_mps),
    )
    assert own_rules(traits_or_usual(silent, rules), rules, True) == kept


def test_a_vehicle_cruises_at_v0_or_at_its_own_top_speed():
    assert cruise_mps(truck(), RULES_27) == 24.0
    assert cruise_mps(truck(), RULES) == 20.0


def test_own_rules_take_what_is_lower():
    own = own_rules(truck(braking_mps2=1.8, time_gap_s=1.5), RULES_27, True)
    assert own.road == RULES_27.road._replace(mainline_speed_mps=24.0)
    # 5.5 W/kg over v_R0 = 16 m/s; all braking is 1.8 m/s2
    assert own.motion.speed_up_mps2 == close(0.34375)
    motion = own.motion
    assert (motion.slow_down_mps2, motion.comfort_mps2, motion.stop_mps2) == (1.8, 1.8, 1.8)
    assert own.safety == SAFETY._replace(time_gap_s=1.5)
    # on the mainline it goes up to its cruise
    assert own_rules(truck(), RULES_27, False).motion.speed_up_mps2 == close(5.5 / 24.0)


def test_own_rules_of_one_that_is_slower_than_the_ramp():
    road = own_rules(truck(top_speed_mps=10.0), RULES, True).road
    assert (road.mainline_speed_mps, road.ramp_speed_mps, road.ramp_limit_mps) == (10.0,) * 3


def test_a_row_that_says_nothing_is_filled_in_with_the_common_budget():
    silent = np.full(len(Traits._fields), math.nan)
    silent[0] = 7.0
    assert traits_or_usual(silent, RULES).tolist() == sized(7.0).tolist()
    assert traits_or_usual(silent, RULES)[MASS] == 1500.0
    told = truck()
    assert traits_or_usual(told, RULES) is told


def test_the_budget_of_a_pair_by_hand():
    front = sized(16.5, positioning_error_m=0.5, clock_error_s=0.01, time_gap_s=9.0)
    rear = sized(5.0, positioning_error_m=0.1, clock_error_s=0.04, time_gap_s=1.2)
    # 0.5 + 0.1 m, 0.01 * 15 and 0.04 * 20 m, (3.6 * 5)^2 / 129.54 m, 1.2 * 20 m
    expected = close(0.6 + 0.15 + 0.8 + 324.0 / 129.54 + 24.0)
    assert safe_distance_m(15.0, 20.0, pair_safety(front, rear, SAFETY)) == expected


speeds = st.floats(0.0, 40.0)
errors = st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 0.5), st.floats(0.0, 3.0))


@given(front=errors, rear=errors, v_front=speeds, v_rear=speeds, still_m=st.floats(0.0, 3.0))
def test_each_ones_own_errors_count_and_the_followers_time_gap(
    front, rear, v_front, v_rear, still_m
):
    budget = SAFETY._replace(standstill_gap_m=still_m)
    rows = [
        sized(5.0, positioning_error_m=p, clock_error_s=c, time_gap_s=g)
        for p, c, g in (front, rear)
    ]
    closing_km_h = 3.6 * max(0.0, v_rear - v_front)
    expected = (front[0] + rear[0] + front[1] * v_front + rear[1] * v_rear + rear[2] * v_rear) + (
        closing_km_h**2 / (254.0 * 0.51) + still_m
    )
    assert safe_distance_m(v_front, v_rear, pair_safety(*rows, budget)) == pytest.approx(
        expected, rel=1e-12, abs=1e-12
    )


def test_equal_vehicles_share_the_common_budget():
    budget = SAFETY._replace(clock_error_s=0.03, time_gap_s=0.8)
    assert pair_safety(sized(5.0, budget), sized(16.5, budget), SAFETY) == budget


def test_one_that_stops_behind_another_counts_its_own_braking_and_errors():
    assert standing_behind_m(sized(), sized(), RULES) == standing_clearance_m(
        RULES.road, SAFETY, RULES.motion.stop_mps2
    )
    # 0.3 + 0.02 m and the allowance; nothing depends on speed
    assert standing_behind_m(sized(positioning_error_m=0.3), sized(), RULES) == close(
        0.32 + 0.1, abs=1e-6
    )
    # braking by 2 m/s2 with a gap of 1 s: T v - v^2 (1 / 4 - 12.96 / 129.54) is most at 3.3348 m/s
    spare = 0.25 - 12.96 / 129.54
    most_m = 0.25 / spare
    assert standing_behind_m(sized(), truck(braking_mps2=2.0, time_gap_s=1.0), RULES) == close(
        0.14 + most_m, abs=1e-6
    )


def test_one_that_stands_behind_another_leaves_room_for_that_to_start():
    # its clock error of 0.2 s asks for 0.2 * 1.5 t, and 0.75 t^2 come about: 0.03 m are missing.
    # One that brakes by 0.9 m/s2 to its stop needs 0.2^2 / 4 / (1 / 1.8 - 0.10005) = 0.022 m
    weak = sized(braking_mps2=0.9)
    assert 0.04 / 4.0 / (1.0 / 1.8 - 12.96 / 129.54) < 0.03
    assert standing_behind_m(sized(clock_error_s=0.2), weak, RULES) == close(0.14 + 0.03, abs=1e-8)
