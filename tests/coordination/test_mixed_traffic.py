"""What holds for any traffic of vehicles that differ: distances, limits, an end for everyone."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.demand.arrivals import arrivals_of
from coramp.scenarios.loading import load_scenario
from tests.situations import SAMPLE_S, driven, loop, states

PRIORITIES = ["mainline-priority", "ramp-priority"]
ABILITIES = {
    "length_m": st.sampled_from([4.0, 12.0, 16.5]),
    "acceleration_mps2": st.sampled_from([None, 0.8, 1.5]),
    "power_wpkg": st.sampled_from([None, 5.5, 12.0]),
    "braking_mps2": st.sampled_from([None, 2.5, 1.3]),
    "top_speed_mps": st.sampled_from([None, [16.0, 18.0], [22.0, 25.0]]),
    "time_gap_s": st.sampled_from([None, 0.0, 0.8]),
    "positioning_error_m": st.sampled_from([None, 0.6]),
    "clock_error_s": st.sampled_from([None, 0.02]),
}


@st.composite
def mixed_scenarios(draw):
    types = []
    for name in ("one", "other", "third"):
        own = {key: draw(values) for key, values in ABILITIES.items()}
        types.append({"name": name, **{key: v for key, v in own.items() if v is not None}})
    for kind, share in zip(types, (0.6, 0.25, 0.15), strict=True):
        kind["share"] = share
    return load_scenario(
        draw(st.sampled_from(["paper", "expressway"])),
        {
            "vehicle": types,
            "safety.time_gap_s": draw(st.sampled_from([0.0, 0.0, 0.6])),
            "safety.standstill_gap_m": draw(st.sampled_from([0.0, 1.0])),
            "control.actuation_delay_s": draw(st.sampled_from([0.1, 0.4])),
            "mainline.flow_veh_h": draw(st.sampled_from([600.0, 1500.0])),
            "ramp.flow_veh_h": draw(st.sampled_from([300.0, 700.0])),
            "simulation.horizon_s": 90.0,
        },
    )


def traits_of(arrivals, coordinator):
    of_row, _ = coordinator.entered()
    return [arrivals[number].traits for number in of_row]


def least_own_margin_m(vehicles, traits, safety):
    """The least distance beyond Eq. 1 of two that share a lane, by what each of them needs."""
    times_s = np.arange(0.0, max(v.pieces[-1, 0] for v in vehicles) + 10.0, SAMPLE_S)
    told = [states(v, times_s) for v in vehicles]
    friction = 254.0 * (safety.adhesion + safety.resistance)
    least_m = math.inf
    for (front_m, front_mps, front_lane), front in zip(told, traits, strict=True):
        for (rear_m, rear_mps, rear_lane), rear in zip(told, traits, strict=True):
            behind = (front_lane == rear_lane) & (rear_m < front_m)
            closing_km_h = 3.6 * np.maximum(0.0, rear_mps - front_mps)
            needed_m = (
                front.positioning_error_m
                + rear.positioning_error_m
                + front.clock_error_s * front_mps
                + (rear.clock_error_s + rear.time_gap_s) * rear_mps
                + closing_km_h**2 / friction
                + safety.standstill_gap_m
            )
            margin_m = front_m - front.length_m - rear_m - needed_m
            least_m = min(least_m, margin_m[behind].min(initial=math.inf))
    return least_m


@pytest.mark.parametrize("strategy", PRIORITIES)
@settings(max_examples=80)
@given(scenario=mixed_scenarios(), seed=st.integers(0, 1000))
def test_distances_and_limits_are_each_vehicles_own_and_everyone_gets_out(strategy, scenario, seed):
    arrivals = arrivals_of(scenario, seed)
    coordinator = loop(scenario, arrivals, strategy, last_s=900.0)
    vehicles, traits = driven(coordinator, arrivals, 900.0), traits_of(arrivals, coordinator)
    assert len(vehicles) == len(arrivals)
    if not vehicles:
        return
    assert coordinator.refusals == []
    least_m = least_own_margin_m(vehicles, traits, scenario.safety)
    assert least_m >= scenario.safety.execution_allowance_m - 1e-6
    for vehicle, own in zip(vehicles, traits, strict=True):
        assert vehicle.until_s < 900.0
        way = vehicle.pieces
        ends_mps = np.append(way[1:, 2], way[-1, 2])
        up = way[:, 3] > 0.0
        able = np.minimum(own.acceleration_mps2, own.power_wpkg / np.maximum(ends_mps, 1e-9))
        assert (way[up, 3] <= able[up] * (1.0 + 1e-6)).all()
        assert way[:, 3].min() >= -min(scenario.motion.comfort_mps2, own.braking_mps2) - 1e-9
        assert way[:, 2].max() <= max(way[0, 2], own.top_speed_mps) + 1e-9
