"""Feeds a log to a fresh coordinator, without any world."""

from typing import Any, NamedTuple

import numpy as np

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.service import Service
from coramp.messages.channel import Channel
from coramp.messages.commands import SetSignal, WorldCommand
from coramp.messages.events import DetectorReading, Report, RequestToEnter
from coramp.messages.feed import RequestFeed
from coramp.messages.kinds import CODES, READING, REPORT, TRAIT_COLUMNS
from coramp.messages.log_reader import MessageLog
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Decider
from coramp.vehicles.traits import Traits


class Replayed(NamedTuple):
    """What a fresh coordinator commanded, and the coordinator."""

    commands: list[WorldCommand]
    coordinator: Coordinator


def requests_in(log: MessageLog) -> list[RequestToEnter]:
    """Returns the requests of a log, in their order."""
    asked = log.frame[log.requests].iter_rows(named=True)
    return [
        RequestToEnter(
            row["vehicle_id"],
            row["stream"] == STREAMS[1],
            step,
            row["speed_mps"],
            row["length_m"],
            row["vehicle_type"],
            _traits_in(row),
            row["lane"] or 0,
        )
        for row, step in zip(asked, log.step[log.requests].tolist(), strict=True)
    ]


def _traits_in(row: dict[str, Any]) -> Traits | None:
    """Returns what a vehicle said that it can do, None where only the common limits bind it."""
    told = {name: row[name] for name in TRAIT_COLUMNS if row[name] is not None}
    return None if set(told) == {"length_m"} else Traits(**told)


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
    """Returns which colours a strategy commands that is told the readings of the log.

    Drivers whom it asks for their reports answer as in the log, for the step before.
    """
    step, step_s, signals = 0, scenario.control.step_s, []
    service = Service(
        strategy,
        scenario.rules(),
        scenario.fastest_mainline_entry_mps,
        lambda: reports_at(log, step - 1),
    )
    by_step: dict[int, list[DetectorReading]] = {}
    for reading in readings_in(log):
        by_step.setdefault(round(reading.time_s / step_s), []).append(reading)
    for step, readings in sorted(by_step.items()):
        commands = service.handle(readings, step)
        signals += [command for command in commands if isinstance(command, SetSignal)]
    return signals


def reports_at(log: MessageLog, step: int) -> list[Report]:
    """Returns the reports of a step, in the order of the log."""
    rows = np.flatnonzero((log.step == step) & (log.codes == CODES[REPORT]))
    told = log.frame[rows].select("vehicle_id", "time_s", "station_m", "speed_mps")
    return [Report(*row) for row in told.iter_rows()]
