"""What holds for any traffic on several lanes: distances, causality, determinism, an end."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.scenarios.loading import load_scenario
from coramp.strategies.registry import strategies
from tests.coordination.test_properties import before
from tests.situations import SAMPLE_S, driven, eq_1, lane_traffic, loop, named, states

STRATEGIES = [name for name, kind in strategies().items() if getattr(kind, "makes_way", False)]
CHANGE_S = 4.5
TYPES = [{"name": "car", "share": 0.7}, {"name": "truck", "share": 0.3}]


def least_margin_in_lanes_m(coordinator, arrivals, safety):
    """The least distance beyond Eq. 1 of any two that share a lane, by dense sampling.

    A vehicle is on the lane that it leaves until it has changed, and on the next one from when it
    begins to.
    """
    vehicles = driven(coordinator, arrivals)
    times_s = np.arange(0.0, max(v.pieces[-1, 0] for v in vehicles) + 10.0, SAMPLE_S)
    fleet = coordinator.ledger.fleet
    station, speed, on_lane = [], [], []
    for row, vehicle in enumerate(vehicles):
        own_m, own_mps, _ = states(vehicle, times_s)
        came = arrivals[coordinator.entered()[0][row]]
        merged = times_s >= fleet.merge_time_s[row]
        begins_s = fleet.change_s[row]
        station.append(own_m)
        speed.append(own_mps)
        here = np.zeros((6, len(times_s)), bool)
        here[5] = ~merged
        here[came.lane] = merged & (times_s < begins_s + CHANGE_S)
        here[came.lane + 1] |= times_s >= begins_s
        on_lane.append(here)
    station, speed, on_lane = np.array(station), np.array(speed), np.array(on_lane)
    least_m = np.inf
    for i, vehicle in enumerate(vehicles):
        share = (on_lane & on_lane[i]).any(axis=1)
        behind = share & (station <= station[i])
        behind[i] = False
        margin = station[i] - vehicle.length_m - station - eq_1(speed[i], speed, safety)
        least_m = min(least_m, float(margin[behind].min(initial=np.inf)))
    return least_m


@pytest.mark.parametrize("strategy", STRATEGIES)
@settings(max_examples=20)
@given(lane_traffic())
def test_no_two_that_share_a_lane_come_nearer_than_promised_and_everyone_gets_through(
    strategy, traffic
):
    scenario, arrivals = traffic
    coordinator = loop(scenario, arrivals, strategy)
    least_m = least_margin_in_lanes_m(coordinator, arrivals, scenario.safety)
    assert least_m >= scenario.safety.execution_allowance_m - 1e-6
    assert coordinator.refusals == []
    assert coordinator.waiting() == []
    assert all(coordinator.ledger.exit_time_s(k) < 400.0 for k in range(len(arrivals)))
    again = loop(scenario, arrivals, strategy)
    assert before(coordinator, 1e9, 0.0) == before(again, 1e9, 0.0)


@pytest.mark.parametrize("strategy", STRATEGIES)
@settings(max_examples=15)
@given(lane_traffic(), st.integers(30, 300), st.randoms(use_true_random=False))
def test_what_arrives_later_on_any_lane_changes_no_decision_before(strategy, traffic, step, random):
    scenario, arrivals = traffic
    early = [a for a in arrivals if a.step < step]
    late = [a._replace(step=a.step + random.randrange(50)) for a in arrivals if a.step >= step]
    late = [a for a in late if random.random() < 0.7]
    one = loop(scenario, arrivals, strategy)
    other = loop(scenario, named([*early, *late]), strategy)
    delay_s, time_s = scenario.control.actuation_delay_s, 0.1 * step
    assert before(one, time_s, 0.0) == before(other, time_s, 0.0)
    assert before(one, time_s, delay_s)[1] == before(other, time_s, delay_s)[1]


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_vehicles_that_differ_keep_their_distances_in_every_lane(strategy):
    from coramp.demand.arrivals import arrivals_of

    settings_of = {
        "vehicle": TYPES,
        "mainline.lanes": 2,
        "mainline.flow_veh_h": 2400.0,
        "ramp.flow_veh_h": 600.0,
        "simulation.horizon_s": 60.0,
    }
    scenario = load_scenario("paper", settings_of)
    coordinator = loop(scenario, arrivals_of(scenario, 2), strategy)
    assert coordinator.refusals == []
    assert coordinator.waiting() == []
    assert np.isfinite(coordinator.ledger.fleet.change_s).any()
