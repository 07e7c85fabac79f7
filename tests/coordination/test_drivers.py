"""Drivers report and take no commands: what is commanded all the same is refused and counted."""

import numpy as np
import pytest

from coramp.coordination.drivers import DriverRoad
from coramp.coordination.guard import Guarded
from coramp.coordination.service import Service
from coramp.errors import CorampError
from coramp.messages.commands import SetSignal
from coramp.messages.events import DetectorReading, Report, RequestToEnter
from coramp.scenarios.loading import load_scenario
from coramp.strategies.alinea import Alinea
from coramp.strategies.base import (
    Decision,
    Detectors,
    DriveWithAcceleration,
    FollowTrajectory,
    ReleaseToDriver,
    SetRampSignal,
)
from coramp.vehicles.merge_state import BY_MAINLINE_S

SCENARIO = load_scenario("paper")
PIECES = np.array([[1.0, -900.0, 20.0, 0.0]])
FIRST = -2
HELD = Report("m2", 0.9, -950.0, 19.0)
TOLD = [Report("m1", 0.9, -900.0, 20.0), HELD]


def answering(*commands, **more):
    """A strategy, asked once a second, that always answers so, and notes what it is shown."""

    class Answering:
        period_s, seen = 1.0, []

        def decide(self, view, memory):
            self.seen.append(view)
            view.drivers  # noqa: B018 - asks while it is time
            return Decision(commands, (), memory)

    for name, value in more.items():
        setattr(Answering, name, value)
    return Answering()


def service(strategy, ask=None):
    return Service(strategy, SCENARIO.rules(), SCENARIO.fastest_mainline_entry_mps, ask)


def reading(time_s=1.0):
    return DetectorReading(time_s, 0.25, 0.5, 3)


@pytest.mark.parametrize(
    "command",
    [
        FollowTrajectory(FIRST, PIECES, BY_MAINLINE_S),
        DriveWithAcceleration(FIRST, 1.0, 1.0),
        SetRampSignal(green=False),
    ],
)
def test_what_a_driver_cannot_do_is_refused_and_counted(command):
    live = service(answering(command))
    assert live.handle(TOLD, 10) == ()
    assert live.coordinator.interventions == 1
    assert live.handle(TOLD, 20) == ()
    assert live.coordinator.interventions == 2


def test_each_acceleration_counts_and_trajectories_once_together():
    drives = (DriveWithAcceleration(FIRST, 1.0, 1.0), DriveWithAcceleration(FIRST - 1, 1.0, 1.0))
    follow = (
        FollowTrajectory(FIRST, PIECES, BY_MAINLINE_S),
        FollowTrajectory(FIRST - 1, PIECES, BY_MAINLINE_S),
    )
    live = service(answering(*drives, *follow))
    live.handle(TOLD, 10)
    assert live.coordinator.interventions == 3


def test_a_driver_may_be_left_to_itself():
    live = service(answering(ReleaseToDriver(FIRST)))
    assert live.handle(TOLD, 10) == ()
    assert live.coordinator.interventions == 0


def test_a_vehicle_that_takes_commands_has_no_driver_to_be_left_to():
    live = service(answering(ReleaseToDriver(0)))
    live.handle([RequestToEnter("a1", False, 3, 18.0, 5.0)], 10)
    assert live.coordinator.interventions == 1


def test_a_trajectory_for_a_driver_takes_the_whole_decision_with_it():
    seen = []

    class Both:
        period_s = 1.0

        def decide(self, view, memory):
            seen.append(view)
            own = view.fleet.pieces[:1].copy()
            both = (FollowTrajectory(0, own, BY_MAINLINE_S), FollowTrajectory(FIRST, own, 0.0))
            return Decision(both, (), memory)

    live = service(Both())
    commands = live.handle([RequestToEnter("a1", False, 3, 18.0, 5.0), *TOLD], 10)
    assert [type(command).__name__ for command in commands] == ["Enter"]
    assert len(seen) == 1
    assert live.coordinator.interventions == 1


def test_the_view_has_reports_of_drivers_and_no_commitments():
    watching = answering()
    service(watching).handle(TOLD, 10)
    (view,) = watching.seen
    assert view.drivers.rows.tolist() == [FIRST, FIRST - 1]
    assert view.drivers.reports.time_s.tolist() == [0.9, 0.9]
    assert view.drivers.reports.station_m.tolist() == [-900.0, -950.0]
    assert view.drivers.reports.speed_mps.tolist() == [20.0, 19.0]
    assert len(view.fleet.live) == 0
    assert view.detectors is None


def test_without_anybody_on_the_road_nobody_is_asked():
    watching = answering()
    service(watching).handle([], 10)
    assert watching.seen == []


def test_who_asked_to_enter_is_no_driver():
    watching = answering()
    own = Report("a1", 0.9, -999.0, 18.0)
    service(watching).handle([RequestToEnter("a1", False, 3, 18.0, 5.0), own, HELD], 10)
    assert watching.seen[-1].drivers.rows.tolist() == [FIRST]
    assert watching.seen[-1].drivers.reports.station_m.tolist() == [-950.0]


def test_a_driver_keeps_its_row_and_is_gone_when_only_others_report():
    road = DriverRoad()
    for report in TOLD:
        road.hear(report)
    road.hear(Report("m1", 0.8, -902.0, 20.0))
    assert road.seen().rows.tolist() == [FIRST, FIRST - 1]
    road.hear(Report("m2", 1.9, -931.0, 19.0))
    assert road.seen().rows.tolist() == [FIRST - 1]
    assert road.seen().reports.station_m.tolist() == [-931.0]


def test_who_can_be_asked_is_asked_when_the_strategy_looks():
    answers = list(TOLD)
    watching = answering(period_s=1.0)
    live = service(watching, lambda: answers)
    live.handle([], 10)
    answers.pop(0)
    live.handle([], 20)
    assert [view.drivers.rows.tolist() for view in watching.seen] == [
        [FIRST, FIRST - 1],
        [FIRST - 1],
    ]


def test_readings_reach_the_strategy_and_signals_the_road():
    metering = answering(SetRampSignal(green=False), metered=True)
    live = service(metering)
    assert live.handle([reading()], 10) == (SetSignal(10, green=False),)
    assert live.handle([], 20) == ()  # its clock are the readings
    assert live.handle([reading(2.5)], 30) == (SetSignal(25, green=False),)
    assert [view.time_s for view in metering.seen] == [1.0, 2.5]
    assert metering.seen[0].detectors == Detectors(0.25, 0.5, 3)
    assert live.coordinator.interventions == 0


@pytest.mark.parametrize("time_s", [1.0, 2.1])
def test_readings_of_another_time_are_refused(time_s):
    live = service(Alinea())
    live.handle([], 10)
    with pytest.raises(CorampError, match=r"the road's loops: tell at step .* allowed is 11 to 20"):
        live.handle([reading(time_s)], 20)


def named(strategy):
    strategy.name, strategy.cooperative = "answering", False
    return strategy


def test_a_strategy_of_others_may_name_drivers_in_commands_alone():
    drives = (DriveWithAcceleration(FIRST, 1.0, 1.0),)
    live = service(Guarded(named(answering(*drives))))
    live.handle(TOLD, 10)
    assert live.coordinator.interventions == 1
    nobody = service(Guarded(named(answering(DriveWithAcceleration(-7, 1.0, 1.0)))))
    with pytest.raises(CorampError, match="commands an unknown vehicle, row -7"):
        nobody.handle(TOLD, 10)


def test_who_sets_a_signal_says_how_often():
    with pytest.raises(CorampError, match="answering: period_s: is missing, and it sets a signal"):
        Guarded(named(answering(metered=True, period_s=None)))
