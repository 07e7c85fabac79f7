"""What SUMO does by itself, or refuses, where automated vehicles merge: they go on all the same."""

from pathlib import Path

import libsumo
import numpy as np
import pytest

from coramp.networks.limits import Limits
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.world_sections import Actuators
from coramp.strategies.mixed_slots import MixedSlots
from coramp.worlds.faults.actuators import SlowActuators
from coramp.worlds.sumo.files import SumoOptions
from coramp.worlds.sumo.lanes import LanedRoad, Way
from coramp.worlds.sumo.mixed import begun
from coramp.worlds.sumo.mixed_lanes import LanedPlant
from coramp.worlds.sumo.mixed_plant import NO_GAP_M, NOT_ASSERTIVE
from coramp.worlds.sumo.mixed_setup import Able
from coramp.worlds.sumo.network import LaneSpan

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


class Told:
    """A session in which one vehicle stays where it is on the acceleration lane; keeps calls."""

    def __init__(self, speed_mps):
        self.speed_mps = speed_mps
        self.calls = []

    def lanes(self):
        return {"merge_0"}

    def step_on(self):
        pass

    def on_lanes(self, lanes):
        return ["r1"], [1], [190.0], [self.speed_mps]

    def __getattr__(self, name):
        return lambda *told: self.calls.append((name, *told))

    def of_lanes(self):
        return [call for call in self.calls if call[0].startswith("change_lane")]


def on_the_acceleration_lane(session):
    one = np.ones(1)
    able = Able({"r1": 0}, one > 0, 5.0 * one, 20.0 * one, 2.5 * one, np.inf * one, 6.0 * one)
    slow = SlowActuators(Actuators(), 1, 0.1, np.inf)
    way = Way(("merge",), 0, Limits((0.0,), (20.0,)))
    spans = {"merge_0": LaneSpan(0.0, 200.0, 1.0, -1, True)}
    plant = LanedPlant(session, spans, able, 2, 0.1, 2.0, slow)
    plant.is_on(LanedRoad(Path("none"), way, way, spans, ()))
    return plant


def commanded(plant, changes, asks=True):
    plant.watch.step_on()
    names, _, users = plant.users()
    plant.command(names, users, np.zeros(1), np.array([changes]), np.array([asks]))


def test_sumo_is_told_once_that_a_vehicle_asks_for_room_or_no_longer():
    session = Told(speed_mps=3.0)
    plant = on_the_acceleration_lane(session)
    for asks in (True, True, False, False, True):
        commanded(plant, changes=False, asks=asks)
    told = [call for call in session.calls if call[0] == "ask_drivers"]
    assert told == [("ask_drivers", "r1", False), ("ask_drivers", "r1", True)]


def test_who_is_told_to_merge_does_not_ask_any_more():
    session = Told(speed_mps=3.0)
    plant = on_the_acceleration_lane(session)
    commanded(plant, changes=True, asks=True)
    session.calls.clear()
    commanded(plant, changes=True, asks=False)
    assert not [call for call in session.calls if call[0] == "ask_drivers"]


def test_one_who_stands_changes_without_sumos_check_once_sumo_has_refused_for_a_second():
    session = Told(speed_mps=0.0)
    plant = on_the_acceleration_lane(session)
    commanded(plant, changes=False)
    for _ in range(6):
        commanded(plant, changes=True)
    assert session.of_lanes() == [
        *[("change_lane_if_clear", "r1", 0.1)] * 5,
        ("change_lane_now", "r1", 2),
    ]


def test_one_who_moves_never_changes_without_sumos_check():
    session = Told(speed_mps=3.0)
    plant = on_the_acceleration_lane(session)
    for _ in range(20):
        commanded(plant, changes=True)
    assert session.of_lanes() == [("change_lane_if_clear", "r1", 0.1)] * 20


def test_drivers_make_room_again_for_one_whose_merge_was_refused():
    session = Told(speed_mps=3.0)
    plant = on_the_acceleration_lane(session)
    commanded(plant, changes=True)
    session.calls.clear()
    commanded(plant, changes=False)
    asks = [("take_over_among_drivers", "r1"), ("judge_gaps_by", "r1", NO_GAP_M, NOT_ASSERTIVE)]
    assert session.calls[:2] == asks
    session.calls.clear()
    commanded(plant, changes=False)
    assert not {call[0] for call in session.calls} & {"take_over_among_drivers", "judge_gaps_by"}
