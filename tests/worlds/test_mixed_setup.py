"""What automated vehicles keep on a road, and what SUMO's drivers see of them: by hand."""

import numpy as np
import pytest

from coramp.demand.arrivals import arrivals_of, automated_of
from coramp.mixed.laws import SafetyLaw
from coramp.scenarios.loading import load_scenario
from coramp.worlds.sumo.mixed_setup import (
    Able,
    actuators_of,
    automated_types,
    kept_gap,
    laws_of,
    safety_law_of,
)

OURS = SafetyLaw()
HALF = {"traffic.automated_share": 0.5, "simulation.horizon_s": 300.0}
TYPES = [{"name": "car", "share": 0.7}, {"name": "truck", "share": 0.3}]
G = 9.8


def scenario_of(overrides=None):
    return load_scenario("paper", {**HALF, **(overrides or {})})


def able_of(overrides=None):
    scenario = scenario_of(overrides)
    arrivals = arrivals_of(scenario, 3)
    return arrivals, Able.of(scenario, arrivals, automated_of(scenario, arrivals, 3))


@pytest.mark.parametrize("period_s", [0.1, 0.2, 0.3, 0.5])
def test_nobody_reckons_with_reacting_before_the_next_command(period_s):
    law = safety_law_of(scenario_of(), period_s)
    assert law.reaction_s == max(OURS.reaction_s, period_s)


def test_the_margin_holds_what_drivers_in_euler_steps_stop_shorter():
    """By hand: at 33 m/s and 0.1 s that is 1.65 m, more than 1.2 m."""
    fast = {"mainline.limit_mps": 33.0}
    assert safety_law_of(scenario_of(fast), 0.2).margin_m == pytest.approx(0.5 * 33.0 * 0.1)
    slow = scenario_of()
    shorter_m = 0.5 * slow.mainline.limit_mps * 0.1
    assert safety_law_of(slow, 0.2).margin_m == max(OURS.margin_m, shorter_m)


def test_the_gap_that_is_kept_is_one_that_the_law_on_board_allows():
    """By hand: reaction 0.3 s and a delay of 0.4 s are more than the 0.5 s asked for."""
    asked = {"safety.time_gap_s": 0.5, "safety.standstill_gap_m": 2.0}
    scenario, law = scenario_of(asked), SafetyLaw(reaction_s=0.3, margin_m=1.2)
    assert kept_gap(scenario, law, 0.0) == (2.0, 0.5)
    assert kept_gap(scenario, law, 0.4) == pytest.approx((2.0, 0.7))
    assert kept_gap(scenario_of(), law, 0.1) == pytest.approx((1.2, 0.4))
    gaps = laws_of(scenario, scenario.drivers["fair"], 0.2, 0.4).gaps
    assert gaps.behind_automated_s == pytest.approx(0.7)
    assert gaps.behind_driver_s > gaps.behind_automated_s


def test_the_lane_ends_where_it_does_but_for_3_m():
    law = safety_law_of(scenario_of({"ramp.acceleration_lane_m": 150.0}), 0.2)
    assert law.lane_end_m == pytest.approx(147.0)


def test_on_a_slippery_road_nobody_is_taken_to_brake_harder_than_it_lets_them():
    slippery = {"road.assumed_adhesion": 0.3}
    law = safety_law_of(scenario_of(slippery), 0.2)
    assert law.braking_mps2 == law.driver_mps2 == pytest.approx(0.3 * G)
    assert law.stop_mps2 == min(OURS.stop_mps2, 0.3 * G)
    assert able_of(slippery)[1].braking_mps2.max() == pytest.approx(0.3 * G)
    known = {"road.adhesion": 0.3}
    assert safety_law_of(scenario_of(known), 0.2).braking_mps2 == OURS.braking_mps2


def test_a_heavy_vehicle_reckons_with_its_own_brakes():
    """A truck's are known to do 5 m/s2, a car's are taken to do the law's 6."""
    arrivals, able = able_of({"vehicle": TYPES})
    heavy = np.array([arrival.length_m > 6.0 for arrival in arrivals])
    assert heavy.any()
    assert set(able.braking_mps2[heavy].tolist()) == {5.0}
    assert set(able.braking_mps2[~heavy].tolist()) == {OURS.braking_mps2}


def test_actuators_brake_no_harder_than_the_road_lets_them():
    actuators = actuators_of(scenario_of({"road.adhesion": 0.4}), 1)
    driven = actuators.driven(np.array([0]), np.array([-8.0]))
    assert float(driven[0]) == pytest.approx(-0.4 * G)


def test_drivers_see_gaps_that_are_kept_at_least():
    """Who reacts late keeps more: 0.3 s on board, and 0.8 s until a command acts."""
    scenario = scenario_of({"safety.time_gap_s": 0.5, "safety.standstill_gap_m": 0.5})
    automated = np.ones(3, np.bool_)
    late = automated_types(scenario, automated, 0.2, 0.8)
    assert late.tau_s == pytest.approx(0.3 + 0.8)
    assert late.min_gap_m == pytest.approx(OURS.margin_m)
    assert automated_types(scenario, automated, 0.2, 0.0).tau_s == pytest.approx(0.5)
