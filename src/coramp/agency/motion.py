"""A run's records as arrays: who was due when, and where everybody was.

The tables of this folder are made of these alone, so that they hold for plans, for SUMO's vehicles
and for both among one another.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.kinematics.trajectory import ACCEL, SPEED, STATION, TIME
from coramp.records.run import RunRecords
from coramp.road.lanes import mainline_lane
from coramp.scenarios.model import Scenario
from coramp.vehicles.traits import CAR, Traits

PIECE_COLUMNS = ("time_s", "station_m", "speed_mps", "accel_mps2")


@dataclass(frozen=True)
class Motion:
    """All vehicles of a run and their pieces; times in s, stations in m.

    One entry a vehicle, in the order of ``vehicles.parquet``. ``entry_s`` and ``exit_s`` are nan
    for what never happened, ``until_s`` is when the vehicle left, or the run ended without it.
    ``traits`` are rows of ``vehicles.traits``, infinite where nothing binds. Of pieces there is one
    entry a row of ``rows``, by vehicle and time: ``vehicle`` is whose it is, ``lane`` is that of
    the mainline, 0 next to the ramp, or -1 on the ramp and the acceleration lane.
    """

    scenario: Scenario
    on_ramp: BoolArray
    vehicle_type: tuple[str, ...]
    traits: FloatArray
    scheduled_s: FloatArray
    entry_s: FloatArray
    exit_s: FloatArray
    until_s: FloatArray
    free_flow_s: FloatArray
    delay_s: FloatArray
    fuel_l: FloatArray
    automated: BoolArray
    vehicle: IntArray
    lane: IntArray
    rows: FloatArray

    def __len__(self) -> int:
        return len(self.on_ramp)

    @cached_property
    def on_mainline(self) -> BoolArray:
        """Which pieces are on the mainline, on whichever lane."""
        return np.asarray(self.lane >= 0, np.bool_)

    @property
    def finished(self) -> BoolArray:
        """Who left the zone."""
        return ~np.isnan(self.exit_s)

    @property
    def end_s(self) -> float:
        """When the last vehicle left or the run was cut off; 0 where none was due."""
        return float(self.until_s.max(initial=0.0))

    @cached_property
    def first(self) -> IntArray:
        """The first row of each vehicle, and one entry more."""
        return np.searchsorted(self.vehicle, np.arange(len(self) + 1)).astype(np.int64)

    @cached_property
    def is_last(self) -> BoolArray:
        """Which pieces are the last of their vehicle."""
        return np.append(self.vehicle[1:] != self.vehicle[:-1], True)[: len(self.rows)]

    @cached_property
    def piece_until_s(self) -> FloatArray:
        """When each piece ends: at the next one, or when the vehicle leaves."""
        leaves_s = self.until_s[self.vehicle]
        next_s = np.append(self.rows[1:, TIME], 0.0)[: len(self.rows)]
        return np.minimum(np.where(self.is_last, leaves_s, next_s), leaves_s)

    @cached_property
    def duration_s(self) -> FloatArray:
        """How long each piece is driven."""
        return np.maximum(0.0, self.piece_until_s - self.rows[:, TIME])

    @cached_property
    def way_m(self) -> FloatArray:
        """How far each piece leads."""
        x = self.duration_s
        return (self.rows[:, SPEED] + 0.5 * self.rows[:, ACCEL] * x) * x


def motion_of(run: RunRecords) -> Motion:
    """Returns the motion of a run; CorampError where it does not tell where vehicles were."""
    vehicles, pieces = run.vehicles, run.motion
    place = {name: k for k, name in enumerate(vehicles["vehicle_id"].to_list())}
    ordered = pieces.with_columns(
        place=pl.col("vehicle_id").replace_strict(place, return_dtype=pl.Int64)
    ).sort("place", "time_s", maintain_order=True)
    scheduled_s = _floats(vehicles, "scheduled_s")
    return Motion(
        scenario=run.scenario,
        on_ramp=(vehicles["stream"] == "ramp").to_numpy(),
        vehicle_type=tuple(map(str, _or_else(vehicles, "vehicle_type", CAR))),
        traits=_traits(vehicles, run.scenario),
        scheduled_s=scheduled_s,
        entry_s=_floats(vehicles, "entry_s"),
        exit_s=_floats(vehicles, "exit_s"),
        until_s=scheduled_s + _floats(vehicles, "waiting_s") + _floats(vehicles, "travel_s"),
        free_flow_s=_floats(vehicles, "free_flow_s"),
        delay_s=_floats(vehicles, "delay_s"),
        fuel_l=_floats(vehicles, "fuel_l"),
        automated=np.array(_or_else(vehicles, "automated", run.trajectories is not None), np.bool_),
        vehicle=ordered["place"].to_numpy().astype(np.int64),
        lane=np.array([mainline_lane(name) for name in ordered["lane"]], np.int64),
        rows=ordered.select(PIECE_COLUMNS).to_numpy().reshape(-1, len(PIECE_COLUMNS)),
    )


def _floats(frame: pl.DataFrame, name: str) -> FloatArray:
    return frame[name].cast(pl.Float64).fill_null(np.nan).to_numpy().astype(np.float64)


def _or_else(frame: pl.DataFrame, name: str, usual: str | bool) -> list[str | bool]:
    """A column; of records from before it there was, what all vehicles then were."""
    return frame[name].to_list() if name in frame.columns else [usual] * frame.height


def _traits(vehicles: pl.DataFrame, scenario: Scenario) -> FloatArray:
    """What each vehicle can do, as it was written: null is what nothing binds."""
    usual = scenario.usual_traits(scenario.usual_length_m)
    columns = [
        np.where(np.isnan(own := _floats(vehicles, name)), np.inf, own)
        if name in vehicles.columns
        else np.full(vehicles.height, getattr(usual, name))
        for name in Traits._fields
    ]
    return np.column_stack(columns).astype(np.float64).reshape(-1, len(Traits._fields))


class Passings(NamedTuple):
    """Who passed a station, when (s) and how fast (m/s), one entry a passing."""

    vehicle: IntArray
    time_s: FloatArray
    speed_mps: FloatArray


def passings(
    motion: Motion, on_mainline: bool, station_m: FloatArray | float, lane: int | None = None
) -> Passings:
    """Returns the passings of a station on the mainline, or on the ramp with its acceleration lane.

    ``lane`` is one of the mainline's alone, 0 next to the ramp. ``station_m`` may differ from
    vehicle to vehicle. Each vehicle counts at most once a piece.
    """
    rows = motion.rows
    here_m = np.broadcast_to(np.asarray(station_m, np.float64), len(motion))[motion.vehicle]
    next_m = np.append(rows[1:, STATION], np.inf)[: len(rows)]
    to_m = np.where(motion.is_last, rows[:, STATION] + motion.way_m, next_m)
    there = motion.on_mainline == on_mainline if lane is None else motion.lane == lane
    passes = (rows[:, STATION] <= here_m) & (here_m < to_m) & there
    own, left_m = rows[passes], (here_m - rows[:, STATION])[passes]
    taken_s = time_over_s(own[:, SPEED], own[:, ACCEL], left_m)
    taken_s = np.minimum(taken_s, motion.duration_s[passes])
    speed_mps = np.maximum(0.0, own[:, SPEED] + own[:, ACCEL] * taken_s)
    return Passings(motion.vehicle[passes], own[:, TIME] + taken_s, speed_mps)


def time_over_s(speed_mps: FloatArray, accel_mps2: FloatArray, way_m: FloatArray) -> FloatArray:
    """Returns how long (s) ways take at constant accelerations; infinite where they never end."""
    end_mps = np.sqrt(np.maximum(0.0, speed_mps**2 + 2.0 * accel_mps2 * way_m))
    both_mps = np.maximum(speed_mps + end_mps, 0.0)
    taken_s = np.full(len(way_m), np.inf)
    np.divide(2.0 * way_m, both_mps, out=taken_s, where=both_mps > 0.0)
    return np.where(way_m == 0.0, 0.0, taken_s)
