"""What each stream does interval by interval: counts, time spent, delay, fuel, breakdown."""

import math

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.agency.edie import overlap_s, ratio
from coramp.agency.motion import Motion, passings
from coramp.agency.schemas import INTERVALS
from coramp.kinematics.fuel import FUEL_MODELS, trajectory_fuel_l
from coramp.kinematics.trajectory import ACCEL, SPEED, STATION, TIME
from coramp.metrics.frames import frame_of
from coramp.metrics.queues import (
    INTERVAL_S,
    QUEUE_SPEED,
    loop_station_m,
    queued_intervals,
    sustained,
)
from coramp.metrics.types import free_time_to_s
from coramp.road.rules import packed
from coramp.road.streams import STREAMS
from coramp.vehicles.traits import MASS


def edges_of(motion: Motion, interval_s: float = INTERVAL_S) -> FloatArray:
    """Returns the edges (s) of intervals from 0 until the run ends; the last one may be shorter."""
    end_s = motion.end_s or interval_s
    edges_s = np.arange(math.ceil(end_s / interval_s - 1e-9) + 1, dtype=np.float64) * interval_s
    edges_s[-1] = min(edges_s[-1], end_s)
    return edges_s


def intervals_table(motion: Motion, interval_s: float = INTERVAL_S) -> pl.DataFrame:
    """Returns one row an interval and stream, with the columns of ``INTERVALS``.

    Sums over all rows are those of the run: time spent, waiting, distance, fuel, and for vehicles
    that finished the delay.
    """
    edges_s = edges_of(motion, interval_s)
    loop_mps, broken = breakdowns(motion, edges_s)
    frames = [
        _rows_of(motion, edges_s, bool(stream), loop_mps, broken) for stream in range(len(STREAMS))
    ]
    return pl.concat(frames)


def _rows_of(
    motion: Motion, edges_s: FloatArray, on_ramp: bool, loop_mps: FloatArray, broken: BoolArray
) -> pl.DataFrame:
    own, bins = motion.on_ramp == on_ramp, len(edges_s) - 1
    entered_s = np.where(np.isnan(motion.entry_s), motion.until_s, motion.entry_s)
    driving_s = overlap_s(entered_s[own], motion.until_s[own], edges_s).sum(axis=0)
    waiting_s = overlap_s(motion.scheduled_s[own], entered_s[own], edges_s).sum(axis=0)
    way_m = way_by_interval_m(motion, edges_s)[own].sum(axis=0)
    exits = _counts(motion.exit_s[own], edges_s)
    due = _bins(motion.scheduled_s[own], edges_s)
    arrivals = np.bincount(due, minlength=bins).astype(np.int64)
    return frame_of(
        INTERVALS,
        stream=[STREAMS[on_ramp]] * bins,
        from_s=edges_s[:-1],
        to_s=edges_s[1:],
        arrivals=arrivals,
        entries=_counts(motion.entry_s[own], edges_s),
        exits=exits,
        flow_veh_h=exits * 3600.0 / np.diff(edges_s),
        time_spent_s=driving_s + waiting_s,
        waiting_s=waiting_s,
        vehicle_km=way_m / 1000.0,
        mean_speed_mps=ratio(way_m, driving_s),
        delay_s=delay_by_interval_s(motion, edges_s)[own].sum(axis=0),
        due_delay_s=ratio(np.bincount(due, motion.delay_s[own], minlength=bins), arrivals),
        fuel_l=fuel_by_interval_l(motion, edges_s)[own].sum(axis=0),
        loop_speed_mps=np.full(bins, np.nan) if on_ramp else loop_mps,
        broken_down=[None] * bins if on_ramp else broken,
    )


def _bins(times_s: FloatArray, edges_s: FloatArray) -> IntArray:
    """The interval of each time; the run's very end is in the last one."""
    return np.clip(np.searchsorted(edges_s, times_s, "right") - 1, 0, len(edges_s) - 2)


def _counts(times_s: FloatArray, edges_s: FloatArray) -> IntArray:
    known_s = times_s[~np.isnan(times_s)]
    return np.bincount(_bins(known_s, edges_s), minlength=len(edges_s) - 1).astype(np.int64)


def states_at(motion: Motion, vehicle: IntArray, time_s: FloatArray) -> tuple[IntArray, FloatArray]:
    """Returns the piece that each vehicle drives at a time, and its station (m) then.

    All must have entered by then. After it has left, a vehicle is where it left.
    """
    then_s = np.minimum(time_s, motion.until_s[vehicle])
    span_s = 2.0 * (motion.end_s + 1.0)
    keys = motion.vehicle * span_s + motion.rows[:, TIME]
    piece = np.searchsorted(keys, vehicle * span_s + then_s, "right") - 1
    piece = np.maximum(piece, motion.first[vehicle])
    own = motion.rows[piece]
    x = np.maximum(0.0, then_s - own[:, TIME])
    return piece, own[:, STATION] + (own[:, SPEED] + 0.5 * own[:, ACCEL] * x) * x


def way_by_interval_m(motion: Motion, edges_s: FloatArray) -> FloatArray:
    """Returns how far (m) each vehicle drives in each interval, one row a vehicle."""
    way_m = np.zeros((len(motion), len(edges_s) - 1))
    start_s, end_s = motion.rows[:, TIME], motion.rows[:, TIME] + motion.duration_s
    for k in range(len(edges_s) - 1):
        x = np.maximum(0.0, np.minimum(end_s, edges_s[k]) - start_s)
        y = np.maximum(x, np.minimum(end_s, edges_s[k + 1]) - start_s)
        speed_mps = motion.rows[:, SPEED] + 0.5 * motion.rows[:, ACCEL] * (x + y)
        way_m[:, k] = np.bincount(motion.vehicle, speed_mps * (y - x), minlength=len(motion))
    return way_m


def delay_by_interval_s(motion: Motion, edges_s: FloatArray) -> FloatArray:
    """Returns the delay (s) that arises for each vehicle in each interval, one row a vehicle.

    By a time, a vehicle has lost the time since it was due, less what it takes in free flow to
    where it is. The delays of one that finished sum up to its ``delay_s``.
    """
    lost_s = np.zeros((len(motion), len(edges_s)))
    packed_rules = packed(motion.scenario.rules())
    ever = motion.until_s > motion.scheduled_s
    for k, edge_s in enumerate(edges_s):
        then_s = np.minimum(edge_s, motion.until_s)
        lost_s[:, k] = np.maximum(0.0, then_s - motion.scheduled_s)
        gone = motion.exit_s <= edge_s
        lost_s[gone, k] -= motion.free_flow_s[gone]
        here = np.flatnonzero(ever & ~gone & (motion.entry_s < then_s))
        _, station_m = states_at(motion, here, then_s[here])
        for vehicle, at_m in zip(here.tolist(), station_m.tolist(), strict=True):
            on_ramp = bool(motion.on_ramp[vehicle])
            lost_s[vehicle, k] -= free_time_to_s(
                at_m, motion.traits[vehicle], on_ramp, packed_rules
            )
    return np.diff(lost_s, axis=1)


def fuel_by_interval_l(motion: Motion, edges_s: FloatArray) -> FloatArray:
    """Returns the fuel (l) of each vehicle in each interval, one row a vehicle.

    The sum is the fuel that the run tells, its shares are those of the pieces: where these are
    fitted to what drivers drove, they are steadier than it, and alone would tell too little fuel.
    """
    scenario = motion.scenario
    model_of = {
        name: FUEL_MODELS.index(scenario.type_named(name).fuel) for name in set(motion.vehicle_type)
    }
    fuel_l = np.zeros((len(motion), len(edges_s) - 1))
    for vehicle, kind in enumerate(motion.vehicle_type):
        pieces = motion.rows[motion.first[vehicle] : motion.first[vehicle + 1]]
        if not len(pieces):
            continue
        start_s, until_s = pieces[0, TIME], motion.until_s[vehicle]
        for k in range(len(edges_s) - 1):
            from_s, to_s = max(start_s, edges_s[k]), min(until_s, edges_s[k + 1])
            if to_s > from_s:
                mass_kg = motion.traits[vehicle, MASS]
                fuel_l[vehicle, k] = trajectory_fuel_l(
                    pieces, from_s, to_s, model_of[kind], mass_kg
                )
    return fuel_l * ratio(motion.fuel_l, fuel_l.sum(axis=1), where_none=1.0)[:, None]


def breakdowns(motion: Motion, edges_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Returns the mean speed (m/s) at the loop upstream, and whether the merge is broken down.

    One entry an interval; nan where nobody passes the loop. As in ``metrics.queues``: intervals of
    queueing count as breakdown where it lasts for 15 min.
    """
    scenario, bins = motion.scenario, len(edges_s) - 1
    found = passings(motion, True, loop_station_m(scenario))
    by_mainline = ~motion.on_ramp[found.vehicle]
    place = _bins(found.time_s[by_mainline], edges_s)
    counts = np.bincount(place, minlength=bins).astype(np.int64)
    sums_mps = np.bincount(place, found.speed_mps[by_mainline], minlength=bins).astype(np.float64)
    least_mps = QUEUE_SPEED * scenario.mainline.speed_mps
    queued = queued_intervals(sums_mps, counts, least_mps)
    return ratio(sums_mps, counts), sustained(queued)
