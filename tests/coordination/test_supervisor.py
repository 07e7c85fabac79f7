"""Commands by acceleration: carried out, replaced and counted."""

import math
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.plant import Arrival
from coramp.kinematics.trajectory import station_and_speed
from coramp.messages.feed import RequestFeed
from coramp.road.lanes import RAMP
from coramp.scenarios.loading import load_scenario
from coramp.strategies.base import Decision, DriveWithAcceleration
from tests.situations import driven, least_margin_m, loop, named, situations

RULES = load_scenario("paper").rules()
NOW_S = 5.0


class Silent:
    """Plans nobody."""

    def decide(self, view, memory):
        return Decision((), tuple((view.time_s, row) for row in view.subjects[1:]), memory)


def loop_of(*arrivals):
    """A loop at 5 s; arrivals are stream (m or r), time in s and speed."""
    listed = [Arrival("", s == "r", round(t / 0.1), v, 5.0) for s, t, v in arrivals]
    coordinator = Coordinator(Silent(), RULES, RequestFeed(named(listed)), 20.0)
    coordinator.expect_arrivals()
    coordinator.run(round(NOW_S / 0.1))
    return coordinator


def commanded(coordinator, *commands, at_s=NOW_S):
    before = coordinator.interventions
    drives = tuple(DriveWithAcceleration(*command) for command in commands)
    coordinator.carry_out(Decision(drives), (), round(at_s / 0.1))
    return coordinator.interventions - before


def test_a_lane_vehicle_does_it_and_goes_back_to_v0():
    loop = loop_of(("m", 0.0, 20.0))
    assert commanded(loop, (0, -1.0, 2.0)) == 0
    pieces = loop.ledger.trajectory(0)
    assert pieces[0, 0] == pytest.approx(NOW_S + 0.1)  # one step later
    assert station_and_speed(pieces, NOW_S + 2.1)[1] == pytest.approx(18.0)
    assert pieces[-1, 2:].tolist() == [20.0, 0.0]
    # 2 s down by 2 m/s, then up again with 1.5 m/s2
    assert pieces[-1, 0] == pytest.approx(NOW_S + 2.1 + 2.0 / 1.5)


def test_nobody_is_sped_up_beyond_the_limit_or_below_a_stand():
    loop = loop_of(("m", 0.0, 20.0), ("r", 0.0, 16.0))
    assert commanded(loop, (0, 1.0, 2.0), (1, 1.5, 3.0, False)) == 0
    assert loop.ledger.trajectory(0)[:, 2].max() == 20.0
    assert loop.ledger.trajectory(1)[:, 2].max() == pytest.approx(17.0)
    assert commanded(loop, (1, -2.9, 20.0, False), at_s=6.0) == 0
    assert loop.ledger.trajectory(1)[:, 2].min() == 0.0


def test_what_is_not_safe_is_counted_and_the_commitment_stays():
    loop = loop_of(("m", 0.0, 20.0), ("m", 0.6, 20.0))
    before = [loop.ledger.trajectory(row).copy() for row in (0, 1)]
    # who is ahead by 12 m brakes hard for 4 s: the one behind would run into it
    assert commanded(loop, (0, -2.9, 4.0)) == 1
    for row in (0, 1):
        np.testing.assert_array_equal(loop.ledger.trajectory(row), before[row])


def test_what_another_command_stands_in_the_way_of_is_tried_after_it():
    loop = loop_of(("m", 0.0, 20.0), ("m", 0.6, 20.0))
    assert commanded(loop, (0, -2.9, 4.0), (1, -2.9, 4.0)) == 0
    lowest = [loop.ledger.trajectory(row)[:, 2].min() for row in (0, 1)]
    assert lowest == [pytest.approx(20.0 - 2.9 * 4.0)] * 2


def test_harder_than_comfort_is_refused():
    loop = loop_of(("m", 0.0, 20.0))
    assert commanded(loop, (0, -3.5, 1.0)) == 1
    assert commanded(loop, (0, -2.9, 1.0)) == 0


def test_a_ramp_vehicle_merges_as_soon_as_that_is_safe_and_known():
    loop = loop_of(("r", 0.0, 16.0))
    assert commanded(loop, (0, 0.0, 0.5)) == 0
    # 80 m along the ramp: a lane vehicle that enters now could still be there before it
    assert loop.ledger.merge_time_s(0) == math.inf
    loop.run(130)
    assert commanded(loop, (0, 0.0, 0.5), at_s=13.0) == 0
    merge_s = loop.ledger.merge_time_s(0)
    # 25 s to the nose, 2 s up to 20 m/s, on the clock
    assert merge_s == pytest.approx(27.0)
    assert merge_s == pytest.approx(round(merge_s, 1))


def test_without_leave_to_merge_it_stops_before_the_nose():
    loop = loop_of(("r", 0.0, 16.0))
    loop.run(130)
    assert commanded(loop, (0, 0.0, 0.5, False), at_s=13.0) == 0
    assert loop.ledger.merge_time_s(0) == math.inf
    assert loop.ledger.trajectory(0)[-1, 1:3].tolist() == [RULES.road.stop_station_m, 0.0]


def test_the_second_on_the_ramp_stops_behind_the_first():
    loop = loop_of(("r", 0.0, 16.0), ("r", 1.5, 16.0))
    assert commanded(loop, (0, 0.0, 0.5, False), (1, 0.0, 0.5, False)) == 0
    first, second = (loop.ledger.trajectory(row)[-1, 1] for row in (0, 1))
    assert second < first - 5.0


class Wild:
    """Commands everyone anything, from full braking to full power, for any time, merges or not."""

    period_s = 0.5

    def __init__(self, random):
        self._random = random

    def decide(self, view, memory):
        if view.subjects:
            return Decision()
        chosen = [row for row in view.fleet.live.tolist() if self._random.random() < 0.8]
        return Decision(
            tuple(
                DriveWithAcceleration(
                    row,
                    self._random.choice([-3.5, -2.94, -1.0, 0.0, 0.7, 1.5, 5.0]),
                    self._random.choice([0.1, 0.5, 0.73, 3.0]),
                    self._random.random() < 0.7,
                )
                for row in chosen
            )
        )


@settings(max_examples=60)
@given(situations(), st.integers(0, 2**32))
def test_whatever_is_commanded_everyone_keeps_its_distance(situation, seed):
    scenario, arrivals, _ = situation
    coordinator = loop(scenario, arrivals, Wild(Random(seed)), last_s=120.0)
    vehicles = driven(coordinator, arrivals, 120.0)
    least_m = least_margin_m(vehicles, scenario.safety)
    assert least_m >= scenario.safety.execution_allowance_m - 1e-6
    for vehicle in vehicles:
        assert vehicle.pieces[:, 2].min() >= -1e-9
        assert vehicle.pieces[:, 3].min() >= -scenario.rules().motion.comfort_mps2 - 1e-9
        ramp_m = vehicle.pieces[vehicle.lanes == RAMP, 1]
        assert ramp_m.max(initial=-1.0) <= 1e-6


@settings(max_examples=30)
@given(situations(), st.integers(0, 2**32))
def test_how_much_room_the_book_has_changes_nothing(situation, seed):
    """The book's first size is that of all arrivals: what depends on it would know the future."""
    scenario, arrivals, _ = situation
    histories = []
    for room in (1, 5000):
        coordinator = Coordinator(
            Wild(Random(seed)),
            scenario.rules(),
            RequestFeed(arrivals),
            scenario.fastest_mainline_entry_mps,
        )
        coordinator.ledger.make_room(room)
        coordinator.expect_arrivals()
        coordinator.run(600)
        histories.append(
            [(c.row, c.pieces.tolist()) for c in coordinator.ledger.history]
            + [coordinator.interventions]
        )
    assert histories[0] == histories[1]


def test_many_commands_make_the_book_grow():
    loop = loop_of(("m", 0.0, 20.0), ("r", 0.0, 16.0))
    for k in range(60):
        at_s = NOW_S + 0.1 * k
        assert commanded(loop, (0, -0.1, 0.1), (1, 0.0, 0.1, False), at_s=at_s) == 0
    assert len(list(loop.ledger.history)) == 2 + 120
