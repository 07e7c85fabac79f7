"""Queues over time, on the ramp and on the mainline.

A vehicle queues from when it is slower than 5 km/h until it is faster than 10 km/h. Queued vehicles
belong together where at most 20 m lie between them. These are the usual settings of a queue counter
(PTV Vissim). What is slow without standing is told by congestion: stretches of 50 m whose mean
speed over 30 s is below 75 % of free flow, as for a breakdown. Several lanes of the mainline count
together: who queues on any of them, the longest of their queues, and the mean speed of all.
"""

import numpy as np
import polars as pl

from coramp._kernel import FloatArray, IntArray
from coramp.agency.contour import CELL_S, ROADS, Cells, cells_of
from coramp.agency.motion import Motion
from coramp.agency.schemas import QUEUES
from coramp.kinematics.trajectory import ACCEL, SPEED, STATION, TIME
from coramp.metrics.frames import frame_of
from coramp.metrics.queues import QUEUE_SPEED
from coramp.vehicles.traits import LENGTH

BEGINS_MPS, ENDS_MPS = 5.0 / 3.6, 10.0 / 3.6
TOGETHER_M = 20.0
SAMPLE_S = 1.0


def queues_table(motion: Motion) -> pl.DataFrame:
    """Returns one row an interval of 30 s and road, with the columns of ``QUEUES``.

    Queues and who waits outside are the largest of the interval's whole seconds.
    """
    sampled = queued_samples(motion)
    frames = []
    for name in ROADS:
        cells = cells_of(motion, name)
        bins = len(cells.edges_s) - 1
        own = sampled.filter(on_mainline=cells.road.is_mainline)
        at_second = (
            own.group_by("second", "lane")
            .agg(pl.len(), pl.col("fills_m").sum())
            .group_by("second")
            .agg(pl.col("len").sum(), pl.col("fills_m").max())
        )
        second = at_second["second"].to_numpy()
        waiting = waiting_by_second(motion, cells.road.is_mainline)
        frames.append(
            frame_of(
                QUEUES,
                road=[name] * bins,
                time_s=cells.edges_s[:-1],
                queued=_largest(second, at_second["len"].to_numpy(), bins).astype(np.int64),
                queue_m=_largest(second, at_second["fills_m"].to_numpy(), bins),
                congested_m=congested_m(cells),
                waiting=_largest(np.arange(len(waiting)), waiting, bins).astype(np.int64),
            )
        )
    return pl.concat(frames)


def _largest(second: IntArray, values: IntArray | FloatArray, bins: int) -> FloatArray:
    """The largest value of each interval, 0 where there is none."""
    found = np.zeros(bins)
    place = (second * SAMPLE_S / CELL_S).astype(np.int64)
    np.maximum.at(found, place[place < bins], values[place < bins])
    return found


def congested_m(cells: Cells) -> FloatArray:
    """Returns how much (m) of a road is congested in each interval."""
    slow = cells.speed_mps < QUEUE_SPEED * cells.road.free_mps
    return np.asarray((slow * np.diff(cells.edges_m)[None, :]).sum(axis=1))


def waiting_by_second(motion: Motion, by_mainline: bool) -> IntArray:
    """Returns how many vehicles are due and not on the road yet, second by second."""
    own = motion.on_ramp != by_mainline
    entered_s = np.where(np.isnan(motion.entry_s), motion.until_s, motion.entry_s)[own]
    seconds = np.arange(int(motion.end_s / SAMPLE_S) + 1) * SAMPLE_S
    due = np.searchsorted(np.sort(motion.scheduled_s[own]), seconds, "right")
    return due - np.searchsorted(np.sort(entered_s), seconds, "right")


def queued_samples(motion: Motion) -> pl.DataFrame:
    """Returns who queues at each whole second: vehicle, second, lane, station, and road it fills.

    ``fills_m`` is the vehicle's length and, where the one ahead in its lane queues within 20 m, the
    room between the two.
    """
    sampled = samples(motion, SAMPLE_S)
    state = (
        pl.when(pl.col("speed_mps") < BEGINS_MPS)
        .then(True)
        .when(pl.col("speed_mps") > ENDS_MPS)
        .then(False)
    )
    queued = sampled.with_columns(
        queued=state.forward_fill().over("vehicle", order_by="second").fill_null(value=False)
    ).filter("queued")
    length_m = motion.traits[:, LENGTH]
    queued = queued.with_columns(
        length_m=pl.Series(length_m[queued["vehicle"].to_numpy()], dtype=pl.Float64)
    ).sort("second", "lane", "station_m", descending=[False, False, True])
    ahead = (pl.col("station_m") - pl.col("length_m")).shift(1).over("second", "lane")
    gap = (ahead - pl.col("station_m")).clip(lower_bound=0.0)
    room = pl.when(gap <= TOGETHER_M).then(gap).otherwise(0.0).fill_null(0.0)
    return queued.with_columns(fills_m=pl.col("length_m") + room)


def samples(motion: Motion, step_s: float) -> pl.DataFrame:
    """Returns vehicle, second, lane, station (m) and speed (m/s) at all multiples of a step."""
    start_s = motion.rows[:, TIME]
    low = np.ceil(start_s / step_s - 1e-9).astype(np.int64)
    high = np.ceil((start_s + motion.duration_s) / step_s - 1e-9).astype(np.int64)
    counts = np.maximum(0, high - low)
    piece = np.repeat(np.arange(len(low)), counts)
    second = low[piece] + np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    own = motion.rows[piece]
    x = np.maximum(0.0, second * step_s - own[:, TIME])
    return pl.DataFrame(
        {
            "vehicle": motion.vehicle[piece],
            "second": second,
            "on_mainline": motion.on_mainline[piece],
            "lane": motion.lane[piece],
            "station_m": own[:, STATION] + (own[:, SPEED] + 0.5 * own[:, ACCEL] * x) * x,
            "speed_mps": own[:, SPEED] + own[:, ACCEL] * x,
        }
    )
