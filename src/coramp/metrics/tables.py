"""From an outcome to the tables that a run leaves behind and the figures that sum it up."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import polars as pl

from coramp._kernel import FloatArray, IntArray
from coramp.coordination.coordinator import DecisionRecord
from coramp.messages.log import as_frame
from coramp.metrics.attempts import attempts_table
from coramp.metrics.fitting import fitted_pieces
from coramp.metrics.lane_figures import bound_figures, braking_figures
from coramp.metrics.lane_uses import lane_uses
from coramp.metrics.motion import (
    BIN_S,
    binned_motion,
    fuel_of_each_l,
    hardest_braking_mps2,
    largest_jerk_mps3,
)
from coramp.metrics.queues import queue_figures
from coramp.metrics.separations import (
    DRAC,
    FIGURES,
    MARGIN,
    MERGE_FRONT,
    MERGE_REAR,
    NOTED,
    SEVERITY,
    TTC,
    lane_extremes,
)
from coramp.metrics.separations import VIOLATIONS as COUNT
from coramp.metrics.types import (
    free_flow_of_each_s,
    fuel_models_of,
    trait_columns,
    traits_of,
    type_figures,
)
from coramp.records.outcome import LANES, Outcome
from coramp.records.schemas import (
    DECISIONS,
    SPEEDS,
    TRAJECTORIES,
    TYPES,
    VEHICLES,
    VIOLATIONS,
    Row,
    Schema,
)
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario
from coramp.strategies.situation import RUNGS
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
        }
        return {name: frame for name, frame in every.items() if frame is not None}

    @cached_property
    def vehicles(self) -> pl.DataFrame:
        """One row a vehicle."""
        columns = dict(self.vehicle_columns)
        columns["stream"] = _stream_names(columns["stream"])
        traits = trait_columns(traits_of(self.outcome.passages, self.scenario))
        return _frame(VEHICLES, **columns, **traits)

    @cached_property
    def speeds(self) -> pl.DataFrame:
        """One row a stream and bin of 1 s in which there were vehicles."""
        columns = dict(self.speed_columns)
        columns["stream"] = _stream_names(columns["stream"])
        return _frame(SPEEDS, **columns)

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
        "vehicle_type": passages.vehicle_type or ("car",) * len(passages),
    }


def _stream_names(streams: IntArray) -> list[str]:
    return [STREAMS[stream] for stream in streams.tolist()]


def _frame(schema: Schema, **columns: Any) -> pl.DataFrame:
    frame = pl.DataFrame({name: columns[name] for name in schema}, schema=schema)
    return frame.with_columns(pl.col(pl.Float64).fill_nan(None))


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


def trajectories_table(
    names: Sequence[str], first: IntArray, rows: FloatArray, lane: IntArray
) -> pl.DataFrame:
    """Returns one row a piece; vehicle i's are ``rows[first[i] : first[i + 1]]``."""
    counts = np.diff(first)
    return _frame(
        TRAJECTORIES,
        vehicle_id=[name for name, n in zip(names, counts, strict=True) for _ in range(n)],
        lane=[LANES[code] for code in lane],
        time_s=rows[:, 0],
        station_m=rows[:, 1],
        speed_mps=rows[:, 2],
        accel_mps2=rows[:, 3],
    )


def violations_table(outcome: Outcome, scenario: Scenario, count: int) -> pl.DataFrame:
    """Returns the ``count`` violations of a run, by time; at which the margin was least."""
    lanes = _extremes_of_lanes(outcome, scenario, count)
    noted = np.concatenate(
        [lane[FIGURES : FIGURES + NOTED * int(lane[COUNT])].reshape(-1, NOTED) for lane in lanes]
    )
    noted = noted[np.argsort(noted[:, 0], kind="stable")]
    names = outcome.passages.vehicle_id
    return _frame(
        VIOLATIONS,
        time_s=noted[:, 0],
        front_vehicle_id=[names[int(front)] for front in noted[:, 1]],
        rear_vehicle_id=[names[int(rear)] for rear in noted[:, 2]],
        margin_m=noted[:, 3],
    )


NAMED_ROWS = {
    "vehicle_id": "row",
    "conflict_vehicle_id": "conflict_row",
    "front_vehicle_id": "front_row",
    "rear_vehicle_id": "rear_row",
}


def decisions_table(
    decisions: Sequence[DecisionRecord], vehicle_ids: Sequence[str], vehicle_of_row: IntArray
) -> pl.DataFrame:
    """Returns one row a decision; what a decision has not is null."""

    def name(row: int) -> str | None:
        return vehicle_ids[vehicle_of_row[row]] if row >= 0 else None

    rows = []
    for decision in decisions:
        why = decision.explanation
        row: Row = {key: getattr(why, key, None) for key in DECISIONS}
        row.update({key: name(getattr(why, field)) for key, field in NAMED_ROWS.items()})
        row["time_s"] = decision.time_s
        row["scenario"] = why.scenario or None
        row["adjusted_vehicle_ids"] = [name(adjusted) for adjusted in decision.adjusted_rows]
        row["min_margin_m"] = decision.min_margin_m
        rows.append(row)
    frame = pl.DataFrame(rows, schema=DECISIONS, orient="row")
    return frame.with_columns(pl.col(pl.Float64).fill_nan(None))


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


def safety_figures(outcome: Outcome, scenario: Scenario) -> Row:
    """Returns how near vehicles came and how hard they braked; null where no two met."""
    mainline, ramp = _extremes_of_lanes(outcome, scenario)
    margin_m, equation = _least_margin(mainline, ramp)
    return {
        "collisions": outcome.collisions,
        "safety_violations": int(mainline[COUNT] + ramp[COUNT]),
        "min_margin_m": _finite(margin_m),
        "min_ttc_s": _finite(min(mainline[TTC], ramp[TTC])),
        "max_drac_mps2": float(max(mainline[DRAC], ramp[DRAC])),
        "max_severity": float(mainline[SEVERITY]),
        "max_decel_mps2": float(hardest_braking_mps2(outcome.pieces.rows)),
        "max_jerk_mps3": _largest_jerk_mps3(outcome),
        "plan_error_m": _largest(outcome.passages.plan_error_m),
        "min_margin_equation": equation,
        "min_merge_margin_m": _finite(min(mainline[MERGE_FRONT], mainline[MERGE_REAR])),
    }


def _least_margin(mainline: FloatArray, ramp: FloatArray) -> tuple[float, int | None]:
    """Returns the least margin (m) over Eq. 1, or over 15 or 16 where one of these is broken.

    With it comes the number of the equation, None where no two vehicles met.
    """
    by_equation = {
        1: min(mainline[MARGIN], ramp[MARGIN]),
        15: min(mainline[MERGE_FRONT], 0.0),
        16: min(mainline[MERGE_REAR], 0.0),
    }
    broken = {number: margin for number, margin in by_equation.items() if margin < 0.0}
    candidates = broken or {1: by_equation[1]}
    equation = min(candidates, key=lambda number: float(candidates[number]))
    return float(candidates[equation]), equation if math.isfinite(candidates[equation]) else None


def _largest_jerk_mps3(outcome: Outcome) -> float:
    pieces = outcome.pieces
    return float(largest_jerk_mps3(pieces.first, pieces.rows, outcome.until_s))


def _extremes_of_lanes(outcome: Outcome, scenario: Scenario, room: int = 0) -> list[FloatArray]:
    """What ``lane_extremes`` finds on the mainline and on the ramp."""
    rules = scenario.rules()
    return [
        lane_extremes(lane, rules.road.merge_angle_rad, rules.safety, room)
        for lane in lane_uses(outcome, traits_of(outcome.passages, scenario))
    ]


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _largest(values: FloatArray) -> float | None:
    known = values[~np.isnan(values)]
    return float(known.max()) if len(known) else None


def _decision_figures(outcome: Outcome) -> Row:
    """How many ramp vehicles each rung served (hold: how many waited), how many others moved."""
    if not outcome.cooperative:
        rungs = {f"rung_{rung}": None for rung in RUNGS}
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
        **{f"rung_{rung}": len(rows) for rung, rows in served.items()},
        "refused_plans": len(outcome.refusals),
        "interventions": outcome.interventions,
    }
