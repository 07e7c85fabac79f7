"""What an audit reads: the folder of a run, and its log as orders and positions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from coramp._kernel import IntArray
from coramp.audit.orders import Askers, Orders
from coramp.checker.merging import NOT_COMMANDED, ON_IT_AT_ENTRY
from coramp.errors import CorampError
from coramp.messages.commands import Enter, SetSignal, WorldCommand
from coramp.messages.kinds import COMMAND, ENTRY, TRAIT_COLUMNS
from coramp.messages.log_reader import MessageLog, read_log
from coramp.records.run import MESSAGES, RunRecords
from coramp.records.run_folder import read_run
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario


@dataclass(frozen=True)
class Inputs:
    """A run and its log. ``order_rows`` are the rows of the orders, one a trajectory."""

    folder: Path
    run: RunRecords
    scenario: Scenario
    log: MessageLog
    askers: Askers
    orders: Orders
    order_rows: IntArray

    @property
    def step_s(self) -> float:
        """The control clock's step (s)."""
        return self.scenario.control.step_s

    @property
    def end_s(self) -> float:
        """When the run ended (s)."""
        return self.log.end_step * self.step_s

    @property
    def exact(self) -> bool:
        """Whether no simulator carried the vehicles."""
        return bool(self.run.content["engine"] == "exact")


def read_inputs(folder: Path, put_in_order: bool = False) -> Inputs:
    """Returns what there is to audit; raises CorampError for what cannot be read.

    ``put_in_order`` puts messages that are out of place where they belong. Orders are empty where
    the log has messages of vehicles that never asked to enter.
    """
    run = read_run(folder)
    scenario = run.scenario
    known = set(run.vehicles["vehicle_id"].to_list())
    path = folder / f"{MESSAGES}.parquet"
    if run.is_unplanned and not path.exists():
        raise CorampError(
            f"{folder}: automated vehicles drove among drivers here, and such runs keep no log "
            "that an audit could repeat; audit a run of automated vehicles alone, or of drivers "
            "alone"
        )
    log = read_log(path, scenario.control.step_s, known, put_in_order)
    askers = _askers(log, scenario)
    rows = log.of_kind(ENTRY, COMMAND)[: 0 if len(log.strangers) else None]
    return Inputs(folder, run, scenario, log, askers, _orders(log, askers, rows), rows)


def _askers(log: MessageLog, scenario: Scenario) -> Askers:
    asked = log.frame[log.requests]
    usual = scenario.usual_traits(0.0)
    traits = [asked[name].fill_null(getattr(usual, name)) for name in TRAIT_COLUMNS]
    return Askers(
        (asked["stream"] == STREAMS[1]).to_numpy(),
        asked["time_s"].to_numpy(),
        asked["speed_mps"].to_numpy(),
        asked["length_m"].to_numpy(),
        np.column_stack([column.to_numpy() for column in traits]),
        asked["lane"].fill_null(0).to_numpy(),
    )


def _orders(log: MessageLog, askers: Askers, rows: IntArray) -> Orders:
    told = log.frame[rows]
    vehicle = log.vehicle[rows]
    none = np.where(askers.on_ramp[vehicle], NOT_COMMANDED, ON_IT_AT_ENTRY)
    merge_s = told["merge_time_s"].fill_null(np.nan).to_numpy()
    counts = np.diff(log.first)[rows]
    return Orders(
        vehicle,
        told["time_s"].to_numpy(),
        (told["kind"] == ENTRY).to_numpy(),
        np.where(np.isnan(merge_s), none, merge_s),
        told["lane_change_s"].fill_null(np.inf).to_numpy(),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        log.pieces if len(rows) else log.pieces[:0],
    )


def orders_of(
    commands: Sequence[WorldCommand], numbers: Mapping[str, int], step_s: float
) -> Orders:
    """Returns trajectories that were commanded just now, as orders."""
    told = [command for command in commands if not isinstance(command, SetSignal)]
    counts = [len(command.pieces) for command in told]
    return Orders(
        np.array([numbers[command.vehicle_id] for command in told], np.int64),
        np.array([command.step * step_s for command in told], np.float64),
        np.array([isinstance(command, Enter) for command in told], np.bool_),
        np.array([command.merge_time_s for command in told], np.float64),
        np.array([getattr(command, "lane_change_s", np.inf) for command in told], np.float64),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.concatenate([np.empty((0, 4)), *(command.pieces for command in told)]),
    )
