"""The figures of a run that agencies ask for, and what they are called."""

import math
from typing import NamedTuple

import numpy as np
import polars as pl

from coramp.agency.intervals import edges_of
from coramp.agency.level_of_service import (
    KM_PER_MI,
    MERGE,
    density_of,
    level_of_service,
    segments_of,
)
from coramp.agency.motion import Motion
from coramp.metrics.queues import INTERVAL_S
from coramp.records.run import RunRecords
from coramp.records.schemas import Row

PERIOD_S = 900.0
"""The manual's period of analysis: densities are those of the densest 15 min."""
HOUR_S, MINUTE_S = 3600.0, 60.0


class Figure(NamedTuple):
    """What a figure is called, its unit ("" for none) and the digits that it is shown with."""

    name: str
    unit: str = ""
    digits: int = 1

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} ({self.unit})" if self.unit else self.name


FIGURES: dict[str, Figure] = {
    "through": Figure("vehicles through while others arrive", "", 0),
    "throughput_veh_h": Figure("throughput", "veh/h", 0),
    "time_spent_h": Figure("total time spent", "vehicle hours", 2),
    "delay_h": Figure("total delay", "vehicle hours", 2),
    "mainline_delay_s": Figure("mean delay, mainline", "s"),
    "ramp_delay_s": Figure("mean delay, ramp", "s"),
    "mainline_p95_s": Figure("travel time of 95 %, mainline", "s"),
    "ramp_p95_s": Figure("travel time of 95 %, ramp", "s"),
    "broken_down_min": Figure("time broken down", "min", 0),
    "congested_m": Figure("most of the mainline congested", "m", 0),
    "ramp_queue_m": Figure("longest queue on the ramp", "m", 0),
    "mainline_waiting": Figure("most waiting upstream of the mainline", "vehicles", 0),
    "ramp_waiting": Figure("most waiting upstream of the ramp", "vehicles", 0),
    "density_pc_mi_ln": Figure("merge density, densest 15 min", "cars/mile/lane"),
    "fuel_l": Figure("fuel", "l"),
    "co2_kg": Figure("CO₂", "kg"),
    "collisions": Figure("collisions", "", 0),
}
"""In the order in which they are shown."""


def agency_figures(
    run: RunRecords, motion: Motion, tables: dict[str, pl.DataFrame]
) -> dict[str, float | None]:
    """Returns the figures of a run by the keys of ``FIGURES``; None for want of vehicles.

    ``tables`` are those of ``agency_tables``.
    """
    intervals, queues = tables["intervals"], tables["queues"]
    horizon_s = motion.scenario.simulation.horizon_s
    through = int((motion.exit_s <= horizon_s).sum())
    trips = tables["travel_times"].unique("stream", keep="first", maintain_order=True)
    p95_s = dict(trips.select("stream", "p95_s").iter_rows())
    broken = intervals.filter(pl.col("broken_down").fill_null(value=False))
    most = queues.group_by("road").agg(pl.col("queue_m", "congested_m", "waiting").max())
    on: dict[str, Row] = {row["road"]: row for row in most.iter_rows(named=True)}
    return {
        "through": float(through),
        "throughput_veh_h": through * HOUR_S / horizon_s,
        "time_spent_h": float(intervals["time_spent_s"].sum()) / HOUR_S,
        "delay_h": float(motion.delay_s.sum()) / HOUR_S,
        "mainline_delay_s": run.summary["mainline_delay_s"],
        "ramp_delay_s": run.summary["ramp_delay_s"],
        "mainline_p95_s": p95_s["mainline"],
        "ramp_p95_s": p95_s["ramp"],
        "broken_down_min": float((broken["to_s"] - broken["from_s"]).sum()) / MINUTE_S,
        "congested_m": on["mainline"]["congested_m"],
        "ramp_queue_m": on["ramp"]["queue_m"],
        "mainline_waiting": float(on["mainline"]["waiting"]),
        "ramp_waiting": float(on["ramp"]["waiting"]),
        "density_pc_mi_ln": densest_pc_mi_ln(motion),
        "fuel_l": float(motion.fuel_l.sum()),
        "co2_kg": float(tables["emissions"]["co2_kg"].sum()),
        "collisions": float(run.summary["collisions"]),
    }


def densest_pc_mi_ln(motion: Motion) -> float:
    """Returns the merge density (passenger cars per mile and lane) of the densest 15 min.

    They begin with an interval of 5 min; of a shorter run it is that of all of it.
    """
    (merge,) = (s for s in segments_of(motion.scenario) if s.kind == MERGE)
    edges_s = edges_of(motion)
    density_pc_km_ln, _ = density_of(motion, merge, edges_s)
    lasts_s = np.diff(edges_s)
    together = max(1, min(len(lasts_s), round(PERIOD_S / INTERVAL_S)))
    found = [
        float(np.average(density_pc_km_ln[k : k + together], weights=lasts_s[k : k + together]))
        for k in range(len(lasts_s) - together + 1)
    ]
    return max(found) * KM_PER_MI


def letter_of(figures: dict[str, float | None]) -> str:
    """Returns the level of service of the merge in its densest 15 min; F where it broke down."""
    density_pc_mi_ln = figures["density_pc_mi_ln"]
    above = bool(figures["broken_down_min"])
    return level_of_service(density_pc_mi_ln or 0.0, MERGE, above)


def breakdown_min(intervals: pl.DataFrame) -> float:
    """Returns after how many minutes the merge first broke down, nan where it did not."""
    broken = intervals.filter(pl.col("broken_down").fill_null(value=False))
    return math.nan if broken.is_empty() else float(broken["from_s"].min()) / MINUTE_S  # type: ignore[arg-type]
