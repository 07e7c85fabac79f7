"""A coordinator that hears of each vehicle when it comes decides as one that is fed all at once."""

import numpy as np
import pytest

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.service import Service
from coramp.demand.arrivals import arrivals_of
from coramp.errors import CorampError
from coramp.messages.channel import Channel
from coramp.messages.commands import Enter, SetSignal
from coramp.messages.events import Acknowledgement, Report, RequestToEnter
from coramp.messages.feed import RequestFeed
from coramp.scenarios.loading import load_scenario
from coramp.strategies.registry import strategies, strategy_named

COOPERATIVE = [name for name, strategy in strategies().items() if strategy.cooperative]
SCENARIO = load_scenario(
    "paper",
    {
        "mainline.flow_veh_h": 1500.0,
        "ramp.flow_veh_h": 500.0,
        "simulation.horizon_s": 60.0,
    },
)
LAST_STEP = 1500


def listed(commands):
    return [
        (type(c).__name__, c.vehicle_id, c.step, c.merge_time_s, c.pieces.tobytes())
        for c in commands
    ]


def at_once(name, requests):
    channel = Channel()
    coordinator = Coordinator(
        strategy_named(name)(),
        SCENARIO.rules(),
        RequestFeed(requests),
        SCENARIO.fastest_mainline_entry_mps,
        channel,
    )
    coordinator.expect_arrivals()
    coordinator.run(LAST_STEP)
    return listed(channel.commands), coordinator


def service(name="mainline-priority"):
    return Service(strategy_named(name)(), SCENARIO.rules(), SCENARIO.fastest_mainline_entry_mps)


def step_by_step(name, requests):
    live, commands = service(name), []
    by_step = {}
    for request in requests:
        by_step.setdefault(request.step, []).append(request)
    for step in range(LAST_STEP + 1):
        now = live.handle(by_step.get(step, []), step)
        assert all(command.step == step for command in now)
        commands += now
    return listed(commands), live.coordinator


@pytest.mark.parametrize("name", COOPERATIVE)
def test_requests_one_by_one_get_the_decisions_of_all_at_once(name):
    requests = arrivals_of(SCENARIO, 7)
    batch, all_at_once = at_once(name, requests)
    live, one_by_one = step_by_step(name, requests)
    assert len(batch) > len(requests)
    assert live == batch
    assert one_by_one.refusals == all_at_once.refusals
    assert one_by_one.interventions == all_at_once.interventions
    assert repr(one_by_one.decisions) == repr(all_at_once.decisions)
    np.testing.assert_array_equal(one_by_one.entered()[1], all_at_once.entered()[1])


def test_who_enters_is_told_so_first():
    request = RequestToEnter("m1", False, 3, 18.0, 5.0)
    (command,) = service().handle([request, Report("m1", 0.3, -1000.0, 18.0)], 10)
    assert isinstance(command, Enter)
    assert (command.vehicle_id, command.step) == ("m1", 3)
    assert command.pieces[0, :3].tolist() == [3 * 0.1, SCENARIO.mainline.start_m, 18.0]


@pytest.mark.parametrize("step", [4, 11])
def test_requests_of_another_time_are_refused(step):
    live = service()
    live.handle([], 4)
    with pytest.raises(CorampError, match="allowed is 5 to 10"):
        live.handle([RequestToEnter("m1", False, step, 18.0, 5.0)], 10)


def test_time_does_not_go_back():
    live = service()
    live.handle([], 4)
    with pytest.raises(CorampError, match="step 4 has been handled"):
        live.handle([], 4)


@pytest.mark.parametrize("stranger", [{"vehicle_id": "m1"}, SetSignal(0, True)])
def test_what_is_no_event_is_refused_by_its_kind(stranger):
    known = "RequestToEnter, Report, Acknowledgement, DetectorReading"
    line = f"{type(stranger).__name__} is no event; allowed are {known}"
    with pytest.raises(CorampError, match=f"^{line}$"):
        service().handle([stranger], 0)


def test_reports_and_acknowledgements_of_who_asked_change_nothing():
    request = RequestToEnter("m1", False, 3, 18.0, 5.0)
    live = service()
    entered = live.handle([request], 3)
    told = [Report("m1", 0.4, -990.0, 18.0), Acknowledgement("m1", 0.4, 0.3)]
    assert (len(entered), live.handle(told, 4)) == (1, ())


@pytest.mark.parametrize("speed_mps", [float("nan"), float("inf"), 0.0])
def test_a_request_that_is_not_finite_is_refused(speed_mps):
    with pytest.raises(CorampError, match="m1: speed and length must be positive and finite"):
        service().handle([RequestToEnter("m1", False, 0, speed_mps, 5.0)], 0)


def test_a_feed_is_in_order_of_time():
    later, sooner = (RequestToEnter("m", False, step, 18.0, 5.0) for step in (2, 1))
    with pytest.raises(ValueError, match="order of time"):
        RequestFeed([later, sooner])
