"""What detectors told, as series over equal intervals, and when the merge broke down in them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray
from coramp.metrics.queues import INTERVAL_S, QUEUE_SPEED, SUSTAINED

SUSTAINED_S = SUSTAINED * INTERVAL_S


@dataclass(frozen=True)
class Series:
    """Vehicles and mean speeds (m/s, nan where nobody passed) by detector, interval by interval.

    Intervals are equally long and begin at ``begin_s``.
    """

    begin_s: float
    interval_s: float
    vehicles: Mapping[str, FloatArray]
    speed_mps: Mapping[str, FloatArray]

    @property
    def intervals(self) -> int:
        """How many intervals there are."""
        return len(next(iter(self.vehicles.values())))

    @property
    def end_s(self) -> float:
        """When the last interval ends."""
        return self.begin_s + self.intervals * self.interval_s

    def flow_veh_h(self, detector: str) -> FloatArray:
        """Returns the flow past a detector, interval by interval."""
        return self.vehicles[detector] * (3600.0 / self.interval_s)

    def between(self, begin_s: float, end_s: float) -> "Series":
        """Returns the intervals that lie between two times."""
        first = max(0, round((begin_s - self.begin_s) / self.interval_s))
        last = min(self.intervals, round((end_s - self.begin_s) / self.interval_s))
        return Series(
            self.begin_s + first * self.interval_s,
            self.interval_s,
            {name: values[first:last] for name, values in self.vehicles.items()},
            {name: values[first:last] for name, values in self.speed_mps.items()},
        )

    def coarse(self) -> "Series":
        """Returns the same in intervals of 5 min, or as it is where its own are no shorter.

        What is left over at the end is dropped. Speeds are means over vehicles.
        """
        together = max(1, round(INTERVAL_S / self.interval_s))
        whole = self.intervals // together
        if together == 1:
            return self
        vehicles, speeds = {}, {}
        for name, counts in self.vehicles.items():
            blocks = counts[: whole * together].reshape(whole, together)
            ways = np.nan_to_num(self.speed_mps[name][: whole * together]).reshape(blocks.shape)
            vehicles[name] = blocks.sum(1)
            with np.errstate(invalid="ignore"):
                speeds[name] = (blocks * ways).sum(1) / vehicles[name]
        return Series(self.begin_s, self.interval_s * together, vehicles, speeds)


def series_of(readings: pl.DataFrame) -> Series:
    """Returns readings as series; the same detector's lanes and classes are taken together.

    ``readings`` has begin_s, end_s, detector, vehicles and mean_speed_mps, without gaps.
    """
    measured = pl.col("mean_speed_mps").is_not_null() & (pl.col("vehicles") > 0)
    weight = pl.when(measured).then("vehicles").otherwise(0)
    frame = (
        readings.group_by("begin_s", "end_s", "detector")
        .agg(
            pl.col("vehicles").sum(),
            way=(weight * pl.col("mean_speed_mps").fill_null(0.0)).sum(),
            weight=weight.sum(),
        )
        .sort("begin_s")
    )
    begin_s, end_s = frame["begin_s"][0], frame["end_s"][0]
    vehicles, speeds = {}, {}
    for (name,), own in frame.group_by("detector", maintain_order=True):
        vehicles[str(name)] = own["vehicles"].to_numpy().astype(np.float64)
        with np.errstate(invalid="ignore"):
            speeds[str(name)] = own["way"].to_numpy() / own["weight"].to_numpy()
    return Series(begin_s, end_s - begin_s, vehicles, speeds)


def queued(series: Series, detector: str, free_mps: float) -> BoolArray:
    """Returns in which intervals vehicles pass a detector at least 25 % slower than free.

    Where nobody passes it is as it was: a queue may stand.
    """
    found = np.zeros(series.intervals, np.bool_)
    for k, speed_mps in enumerate(series.speed_mps[detector].tolist()):
        slow = speed_mps < QUEUE_SPEED * free_mps
        found[k] = found[k - 1] if np.isnan(speed_mps) and k else slow
    return found


def breakdown_of(series: Series, detector: str, free_mps: float) -> int | None:
    """Returns the interval in which a queue of at least 15 min begins, None where none does."""
    found = queues_of(series, detector, free_mps)
    return found[0][0] if found else None


def queues_of(series: Series, detector: str, free_mps: float) -> list[tuple[int, int]]:
    """Returns the queues of breakdowns: their first intervals, and those after their last ones.

    A queue ends where none was seen for 15 min.
    """
    slow = queued(series, detector, free_mps)
    least = max(1, round(SUSTAINED_S / series.interval_s))
    found, k = [], 0
    while k + least <= len(slow):
        if not slow[k : k + least].all():
            k += 1
            continue
        end = k
        while end < len(slow) and slow[end : end + least].any():
            end += 1
        found.append((k, end))
        k = end
    return found


def capacity_veh_h(series: Series, upstream: str, downstream: str, free_mps: float) -> float | None:
    """Returns the highest flow of 5 min past ``downstream`` before the breakdown, None without one.

    The queue is seen at ``upstream``.
    """
    coarse = series.coarse()
    start = breakdown_of(coarse, upstream, free_mps)
    if not start:
        return None
    return float(coarse.flow_veh_h(downstream)[:start].max())
