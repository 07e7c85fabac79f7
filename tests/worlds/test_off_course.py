"""An automated vehicle among drivers that is not where it was sent is found, and told."""

import numpy as np
import pytest

from coramp.runs.mixed import broken_among_drivers
from coramp.scenarios.world_sections import Actuators
from coramp.worlds.faults.actuators import SlowActuators
from coramp.worlds.sumo.mixed_plant import MixedPlant
from coramp.worlds.sumo.mixed_setup import Able
from coramp.worlds.sumo.network import LaneSpan


class Pushed:
    """A session in which an automated vehicle is where the test says, whatever it was told."""

    position_m = 100.0

    def lanes(self):
        return {"mainline_0"}

    def step_to(self, step):
        pass

    def on_lanes(self, lanes):
        return ["m1"], [1], [self.position_m], [20.0]

    def take_over(self, name):
        pass

    def act_now(self, name):
        pass

    def drive_evenly(self, names, before_mps, after_mps, steps):
        pass


def plant_of(session):
    one, step_s = np.ones(1), 0.1
    able = Able({"m1": 0}, np.ones(1, np.bool_), 5.0 * one, 20.0 * one, 3.0 * one, 30.0 * one, one)
    slow = SlowActuators(Actuators(), 1, step_s, 9.0)
    spans = {"mainline_0": LaneSpan(-400.0, 0.0, 1.0, 0, False)}
    return MixedPlant(session, spans, able, 2, step_s, 2.0, slow)


@pytest.mark.parametrize("off_m", [0.0, 0.03, -0.2])
def test_a_vehicle_that_is_not_where_it_was_sent_is_found(off_m):
    """By hand: at 20 m/s it comes 4 m in 0.2 s."""
    session = Pushed()
    plant = plant_of(session)
    plant.watch.step_to(1)
    names, _, users = plant.users()
    nobody = np.zeros(1, np.bool_)
    plant.command(names, users, np.zeros(1), nobody, nobody)
    session.position_m = 104.0 + off_m
    plant.watch.step_to(3)
    plant.users()
    assert plant.largest_error_m[0] == pytest.approx(abs(off_m), abs=1e-9)


def test_a_run_off_course_breaks_its_promise():
    kept = {"plan_error_m": 0.04, "collisions_by_automated": 0, "automated_violations": 0}
    assert broken_among_drivers(kept) == []
    assert broken_among_drivers({**kept, "plan_error_m": 0.06}) == ["driven 0.060 m off plan"]
    assert broken_among_drivers({**kept, "automated_violations": 2}) == [
        "2 pairs nearer than automated vehicles promise"
    ]
    assert broken_among_drivers({**kept, "collisions_by_automated": 1}) == [
        "1 collisions that automated vehicles caused"
    ]
    assert broken_among_drivers({"plan_error_m": None}) == []
