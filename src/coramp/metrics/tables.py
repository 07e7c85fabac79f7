"""From an outcome to the tables that a run leaves behind and the figures that sum it up."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.messages.log import as_frame
from coramp.metrics.attempts import attempts_table
from coramp.metrics.fitting import fitted_pieces
from coramp.metrics.frames import decisions_table, frame_of, trajectories_table
from coramp.metrics.lane_figures import bound_figures, braking_figures
from coramp.metrics.mixed_figures import mixed_figures, safety_events
from coramp.metrics.mixed_tables import heard_table, on_board_table
from coramp.metrics.motion import (
    BIN_S,
    binned_motion,
    fuel_of_each_l,
)
from coramp.metrics.queues import queue_figures
from coramp.metrics.safety_figures import safety_figures, violations_table
from coramp.metrics.several_lanes import several_lanes_figures
from coramp.metrics.types import (
    free_flow_of_each_s,
    fuel_models_of,
    trait_columns,
    traits_of,
    type_figures,
)
from coramp.records.outcome import Outcome
from coramp.records.schemas import (
    SPEEDS,
    TYPES,
    VEHICLES,
    Row,
)
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario
from coramp.strategies.situation import RUNGS, RUNGS_OF_ONE_LANE
from coramp.vehicles.traits import MASS

Columns = Mapping[str, Any]
"""Columns of a table by name: arrays, nan for what is not there."""


@dataclass(frozen=True)
class RunTables:
    """The figures of a run, and its tables, made when they are asked for.

    There are trajectories and decisions only where there were plans.
    """

    outcome: Outcome
    scenario: Scenario
    vehicle_columns: Columns
    speed_columns: Columns
    metrics: Row
    streams: list[Row]

    def frames(self) -> dict[str, pl.DataFrame]:
        """Returns all tables of the run by name, as they are written."""
        every = {
            "vehicles": self.vehicles,
            "speeds": self.speeds,
            "trajectories": self.trajectories,
            "decisions": self.decisions,
            "positions": self.positions,
            "violations": self.violations,
            "types": self.types,
            "attempts": self.attempts,
            "messages": self.messages,
            "safety_events": self.safety_events,
            "heard": heard_table(self.outcome),
            "on_board": on_board_table(self.outcome),
        }
        return {name: frame for name, frame in every.items() if frame is not None}

    @cached_property
    def vehicles(self) -> pl.DataFrame:
        """One row a vehicle."""
        columns = dict(self.vehicle_columns)
        columns["stream"] = _stream_names(columns["stream"])
        traits = trait_columns(traits_of(self.outcome.passages, self.scenario))
        return frame_of(VEHICLES, **columns, **traits, automated=_automated(self.outcome))

    @cached_property
    def speeds(self) -> pl.DataFrame:
        """One row a stream and bin of 1 s in which there were vehicles."""
        columns = dict(self.speed_columns)
        columns["stream"] = _stream_names(columns["stream"])
        return frame_of(SPEEDS, **columns)

    @cached_property
    def trajectories(self) -> pl.DataFrame | None:
        """One row a driven piece."""
        outcome = self.outcome
        if not outcome.cooperative:
            return None
        return trajectories_table(
            outcome.passages.vehicle_id, outcome.pieces.first, outcome.pieces.rows, outcome.lane
        )

    @cached_property
    def positions(self) -> pl.DataFrame | None:
        """One row a piece fitted to what drivers drove, within 5 cm; None for plans."""
        outcome = self.outcome
        if outcome.cooperative:
            return None
        fitted = fitted_pieces(outcome.pieces.first, outcome.pieces.rows, outcome.lane)
        return trajectories_table(outcome.passages.vehicle_id, *fitted)

    @cached_property
    def messages(self) -> pl.DataFrame | None:
        """One row a message, where they were to be kept."""
        told = self.outcome.told
        return None if told is None else as_frame(told, self.scenario.control.step_s)

    @cached_property
    def types(self) -> pl.DataFrame | None:
        """One row per type of vehicle and stream, where there is more than one type."""
        if len(self.scenario.vehicle_types) == 1:
            return None
        columns = self.vehicle_columns
        rows = type_figures(
            self.outcome.passages, columns["delay_s"], columns["fuel_l"], columns["finished"]
        )
        return pl.DataFrame(rows, schema=TYPES)

    @cached_property
    def violations(self) -> pl.DataFrame:
        """One row a pair that came nearer than the safe distance."""
        return violations_table(self.outcome, self.scenario, self.metrics["safety_violations"])

    @cached_property
    def safety_events(self) -> pl.DataFrame | None:
        """One row per collision, broken assumption, broken promise and event of the world.

        None where all are automated, and of drivers alone in a perfect world.
        """
        if self.outcome.passages.automated is None and not self.scenario.has_faults:
            return None
        return safety_events(self.outcome, self.scenario)

    @cached_property
    def decisions(self) -> pl.DataFrame | None:
        """One row a decision."""
        outcome = self.outcome
        if not outcome.cooperative:
            return None
        return decisions_table(
            outcome.decisions, outcome.passages.vehicle_id, outcome.vehicle_of_row
        )

    @cached_property
    def attempts(self) -> pl.DataFrame | None:
        """One row an attempt of a decision."""
        outcome = self.outcome
        if not outcome.cooperative:
            return None
        names, of_row = outcome.passages.vehicle_id, outcome.vehicle_of_row
        return attempts_table(outcome.decisions, outcome.refusals, names, of_row)


def _automated(outcome: Outcome) -> BoolArray:
    """Which vehicles took commands: all or none, but in mixed traffic."""
    if outcome.passages.automated is not None:
        return outcome.passages.automated
    return np.full(len(outcome.passages), outcome.cooperative)


def tables_of(outcome: Outcome, scenario: Scenario) -> RunTables:
    """Returns all tables and figures of a run."""
    vehicles, speeds = vehicle_columns(outcome, scenario), speed_columns(outcome)
    streams = [stream_figures(vehicles, speeds, stream) for stream in range(len(STREAMS))]
    metrics = {
        **_stream_metrics(streams),
        **safety_figures(outcome, scenario),
        **_decision_figures(outcome),
        **bound_figures(outcome, scenario, vehicles["delay_s"], vehicles["free_flow_s"]),
        **braking_figures(outcome, scenario),
        **queue_figures(outcome, scenario),
        **mixed_figures(outcome, scenario, vehicles["delay_s"]),
        **several_lanes_figures(outcome, scenario, vehicles["delay_s"]),
    }
    return RunTables(outcome, scenario, vehicles, speeds, metrics, streams)


def vehicle_columns(outcome: Outcome, scenario: Scenario) -> Columns:
    """Returns one entry a vehicle; ``stream`` is its place in ``STREAMS``.

    Delay is from scheduled entry to exit, less free flow; for a vehicle that is not out when the
    run is cut off it counts up to then, and is never below 0.
    """
    passages, pieces = outcome.passages, outcome.pieces
    finished = ~np.isnan(passages.exit_s)
    entered = ~np.isnan(passages.entry_s)
    until_s = outcome.until_s
    entry_s = np.where(entered, passages.entry_s, outcome.end_s)
    traits = traits_of(passages, scenario)
    free_flow_s = free_flow_of_each_s(passages, traits, scenario)
    way_m = np.where(passages.on_ramp, -scenario.ramp.start_m, -scenario.mainline.start_m)
    travel_s = until_s - entry_s
    mean_speed_mps = np.full(len(passages), np.nan)
    np.divide(way_m + scenario.mainline.end_m, travel_s, out=mean_speed_mps, where=finished)
    return {
        "vehicle_id": passages.vehicle_id,
        "stream": passages.on_ramp.astype(np.int64),
        "scheduled_s": passages.scheduled_s,
        "entry_s": passages.entry_s,
        "exit_s": passages.exit_s,
        "waiting_s": entry_s - passages.scheduled_s,
        "travel_s": travel_s,
        "free_flow_s": free_flow_s,
        "delay_s": np.maximum(
            until_s - passages.scheduled_s - free_flow_s, np.where(finished, -np.inf, 0.0)
        ),
        "mean_speed_mps": mean_speed_mps,
        "fuel_l": fuel_of_each_l(
            pieces.first, pieces.rows, until_s, fuel_models_of(passages, scenario), traits[:, MASS]
        ),
        "finished": finished,
        "plan_error_m": passages.plan_error_m,
        "vehicle_type": passages.types(),
    }


def _stream_names(streams: IntArray) -> list[str]:
    return [STREAMS[stream] for stream in streams.tolist()]


def speed_columns(outcome: Outcome) -> Columns:
    """Returns the space-mean speed of each stream in bins of 1 s, where there are vehicles."""
    passages, pieces = outcome.passages, outcome.pieces
    until_s = outcome.until_s
    bins = math.ceil(outcome.end_s / BIN_S) + 1
    distance_m, time_s, vehicles = binned_motion(
        pieces.first, pieces.rows, until_s, passages.on_ramp, bins
    )
    stream, used = np.nonzero(time_s > 0.0)
    return {
        "stream": stream,
        "time_s": used * BIN_S,
        "mean_speed_mps": distance_m[stream, used] / time_s[stream, used],
        "vehicles": vehicles[stream, used],
    }


def stream_figures(vehicles: Columns, speeds: Columns, stream: int) -> Row:
    """Returns the figures of one stream, by its place in ``STREAMS``; None for want of vehicles."""
    own = vehicles["stream"] == stream
    finished, delay_s = vehicles["finished"][own], vehicles["delay_s"][own]
    binned_mps = speeds["mean_speed_mps"][speeds["stream"] == stream]
    return {
        "stream": STREAMS[stream],
        "vehicles": len(finished),
        "unserved": len(finished) - int(finished.sum()),
        "delay_s": _of_some(np.mean, delay_s),
        "delay_p95_s": _of_some(partial(np.quantile, q=0.95), delay_s),
        "waiting_s": _of_some(np.mean, vehicles["waiting_s"][own]),
        "speed_mps": _of_some(np.mean, vehicles["mean_speed_mps"][own][finished]),
        "speed_std_mps": _of_some(np.std, binned_mps),
        "fuel_l": float(vehicles["fuel_l"][own].sum()),
    }


def _of_some(statistic: Callable[[FloatArray], Any], values: FloatArray) -> float | None:
    return float(statistic(values)) if len(values) else None


def _stream_metrics(streams: list[Row]) -> Row:
    result: Row = {"unserved": sum(s["unserved"] for s in streams)}
    for figures in streams:
        name = figures["stream"]
        result[f"vehicles_{name}"] = figures["vehicles"]
        for key in ("delay_s", "delay_p95_s", "speed_mps", "speed_std_mps"):
            result[f"{name}_{key}"] = figures[key]
    result["fuel_l"] = sum(s["fuel_l"] for s in streams)
    return result


def _decision_figures(outcome: Outcome) -> Row:
    """How many ramp vehicles each rung served (hold: how many waited), how many others moved."""
    if not outcome.cooperative:
        rungs = {f"rung_{rung}": None for rung in RUNGS_OF_ONE_LANE}
        return {
            "adjusted_vehicles": None,
            **rungs,
            "refused_plans": None,
            "interventions": outcome.interventions or None,
        }
    served: dict[str, set[int]] = {rung: set() for rung in RUNGS}
    adjusted: set[int] = set()
    for decision in outcome.decisions:
        served[decision.explanation.rung].add(decision.explanation.row)
        adjusted.update(decision.adjusted_rows)
    return {
        "adjusted_vehicles": len(adjusted),
        **{f"rung_{rung}": len(served[rung]) for rung in RUNGS_OF_ONE_LANE},
        "refused_plans": len(outcome.refusals),
        "interventions": outcome.interventions,
    }
