"""What SUMO does by itself, or refuses, where automated vehicles merge: they go on all the same."""

import libsumo
import pytest

from coramp.scenarios.loading import load_scenario
from coramp.strategies.mixed_slots import MixedSlots
from coramp.worlds.sumo.files import SumoOptions
from coramp.worlds.sumo.mixed import begun

STANDSTILL_M = 10.0
"""No vehicle keeps as much before it at a stand."""


def empty_road(lanes):
    return load_scenario(
        "paper",
        {
            "mainline.lanes": lanes,
            "mainline.flow_veh_h": 1e-3,
            "ramp.flow_veh_h": 700.0,
            "simulation.horizon_s": 90.0,
            "traffic.automated_share": 0.7,
        },
    )


@pytest.mark.parametrize("lanes", [1, 2])
def test_whom_sumo_moves_onto_an_empty_mainline_lets_others_in_as_all_do(tmp_path, lanes):
    """SUMO changes lanes without a command there; from then on a vehicle keeps its lane and gaps.

    While it is on the ramp SUMO is to find no gap for it, by a standstill gap of 200 m.
    """
    by_themselves, told = set(), set()
    scenario, options = empty_road(lanes), SumoOptions()
    with begun(scenario, MixedSlots(), "fair", 11, options, tmp_path) as run:
        for moment in run.decisions():
            driven = run.carry_out(moment)
            users = moment.users
            for k, name in enumerate(moment.names):
                if not users.automated[k]:
                    continue
                if not users.on_mainline[k]:
                    told |= {name} if driven.changes[k] else set()
                    continue
                by_themselves |= {name} - told
                assert libsumo.vehicle.getMinGap(name) < STANDSTILL_M
                assert libsumo.vehicle.getLaneID(name).endswith(f"_{merged_to(name)}")
    assert by_themselves
    assert told


def merged_to(name):
    """SUMO's number of the mainline's lane next to the ramp: 1 beside the acceleration lane."""
    return int(libsumo.vehicle.getRoadID(name) == "merge")
