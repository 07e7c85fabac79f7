"""Feeds a log to a fresh coordinator, without any world."""

from typing import NamedTuple

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.metered import MeteredRoad
from coramp.messages.channel import Channel
from coramp.messages.commands import Command, SetSignal
from coramp.messages.events import DetectorReading, RequestToEnter
from coramp.messages.feed import RequestFeed
from coramp.messages.log import READING, STREAMS
from coramp.messages.reading import MessageLog
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Decider


class Replayed(NamedTuple):
    """What a fresh coordinator commanded, and the coordinator."""

    commands: list[Command]
    coordinator: Coordinator


def requests_in(log: MessageLog) -> list[RequestToEnter]:
    """Returns the requests of a log, in their order."""
    asked = log.frame[log.requests]
    columns = (asked[name].to_list() for name in ("vehicle_id", "stream", "speed_mps", "length_m"))
    return [
        RequestToEnter(name, stream == STREAMS[1], step, speed_mps, length_m)
        for name, stream, speed_mps, length_m, step in zip(
            *columns, log.step[log.requests].tolist(), strict=True
        )
    ]


def readings_in(log: MessageLog) -> list[DetectorReading]:
    """Returns the readings of a log, in their order."""
    told = log.frame[log.of_kind(READING)]
    return [
        DetectorReading(
            row["time_s"], row["mainline_occupancy"], row["queue_occupancy"], row["passed_veh"]
        )
        for row in told.iter_rows(named=True)
    ]


def replayed(log: MessageLog, scenario: Scenario, strategy: Decider, last_step: int) -> Replayed:
    """Returns what a coordinator commands up to ``last_step`` that is told what the log says."""
    channel = Channel()
    coordinator = Coordinator(
        strategy,
        scenario.rules(),
        RequestFeed(requests_in(log)),
        scenario.fastest_mainline_entry_mps,
        channel,
    )
    coordinator.expect_arrivals()
    coordinator.run(last_step)
    return Replayed(channel.commands, coordinator)


def replayed_signals(log: MessageLog, scenario: Scenario, strategy: Decider) -> list[SetSignal]:
    """Returns which colours a strategy commands that is told the readings of the log."""
    road = MeteredRoad(strategy, scenario.rules(), scenario.fastest_mainline_entry_mps)
    return [signal for reading in readings_in(log) for signal in road.handle(reading)]
