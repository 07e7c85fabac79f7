"""Who asks drivers for room in SUMO does not keep a driver ahead of it from speeding up."""

import numpy as np
import pytest

from coramp.scenarios.loading import load_scenario
from coramp.strategies.mixed_slots import MixedSlots
from coramp.worlds.sumo import mixed_lanes
from coramp.worlds.sumo.files import SumoOptions
from coramp.worlds.sumo.mixed import begun

ROAD = {
    "mainline.lanes": 3,
    "mainline.start_m": -600.0,
    "mainline.end_m": 600.0,
    "mainline.speed_mps": 27.78,
    "mainline.entry_speed_mps": [25.0, 27.78],
    "mainline.limit_mps": 27.78,
    "mainline.flow_veh_h": 5400.0,
    "ramp.start_m": -400.0,
    "ramp.speed_mps": 20.0,
    "ramp.entry_speed_mps": [18.0, 20.0],
    "ramp.limit_mps": 22.0,
    "ramp.flow_veh_h": 900.0,
    "safety.time_gap_s": 1.0,
    "safety.standstill_gap_m": 2.0,
    "traffic.automated_share": 0.5,
    "simulation.horizon_s": 60.0,
}
FREE_M, SLOW_MPS = 60.0, 17.0
"""A driver who is so slow with so much room ahead speeds up, or somebody keeps him from it."""


def longest_held_s(folder, seed):
    """How long drivers next to the ramp did not speed up, though slow and with room ahead."""
    held_s, before_mps = {}, {}
    scenario = load_scenario("paper", ROAD)
    with begun(scenario, MixedSlots(), "credible", seed, SumoOptions(), folder) as run:
        for moment in run.decisions():
            users, beside = moment.users, run.plant.lane == 0
            for k in np.flatnonzero(beside & ~users.automated).tolist():
                ahead_m = users.station_m[beside] - users.station_m[k]
                free = not ((ahead_m > 0.0) & (ahead_m < FREE_M)).any()
                now_mps, name = users.speed_mps[k], moment.names[k]
                if free and now_mps < SLOW_MPS and now_mps < before_mps.get(name, 0.0) + 0.05:
                    held_s[name] = held_s.get(name, 0.0) + run.plant.period_s
                before_mps[name] = now_mps
            run.carry_out(moment)
    return max(held_s.values(), default=0.0)


@pytest.mark.parametrize(("always", "least_s", "most_s"), [(False, 0.0, 1.0), (True, 2.5, 60.0)])
def test_a_driver_ahead_of_a_faster_vehicle_on_the_ramp_speeds_up(
    always, least_s, most_s, tmp_path, monkeypatch
):
    """If vehicles always ask, SUMO takes one for overtaking, and holds the driver ahead of it."""

    def asking(users, *told):
        return (*by_the_law(users, *told)[:3], users.automated & ~users.on_mainline)

    by_the_law = mixed_lanes.decided_in_lanes
    if always:
        monkeypatch.setattr(mixed_lanes, "decided_in_lanes", asking)
    assert least_s <= longest_held_s(tmp_path, seed=16) <= most_s
