"""Level of service by density, as in the Highway Capacity Manual (6th edition 2016, 7th 2022).

Densities count passenger cars per mile and lane: a heavy vehicle stands for two (Exhibit 12-25,
level terrain). The letters of basic segments are those of Exhibit 12-15, those of merge influence
areas, which reach 1,500 ft (457.2 m) downstream from where the ramp joins (Exhibit 14-1), of
Exhibit 14-3. These have the acceleration lane and the two mainline lanes next to it (chapter 14),
other segments all lanes. F is demand above capacity: here, intervals in which the merge is broken
down. Edition 7.1 (2025) has another chapter 14, whose letters (Exhibit 14-2) are not used here:
A to E up to 11, 18, 25, 30 and 35 passenger cars per mile and lane, F above.
"""

from typing import NamedTuple

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.agency.contour import MAINLINE_ROAD, RAMP_ROAD, Road, lanes_of, road_of
from coramp.agency.edie import spent_in_cells
from coramp.agency.intervals import breakdowns, edges_of
from coramp.agency.motion import Motion
from coramp.agency.schemas import LEVELS
from coramp.metrics.frames import frame_of
from coramp.metrics.queues import INTERVAL_S
from coramp.scenarios.model import Scenario

KM_PER_MI = 1.609344
MERGE_INFLUENCE_M, MERGE_INFLUENCE_LANES = 457.2, 2
CARS_PER_TRUCK = 2.0
BASIC_PC_MI_LN = (("A", 11.0), ("B", 18.0), ("C", 26.0), ("D", 35.0), ("E", 45.0))
MERGE_PC_MI_LN = (("A", 10.0), ("B", 20.0), ("C", 28.0), ("D", 35.0), ("E", np.inf))
"""Letters, and the highest density of each."""
BASIC, MERGE = "basic", "merge"
LIMITS = {BASIC: BASIC_PC_MI_LN, MERGE: MERGE_PC_MI_LN}
SHORTEST_M = 50.0
"""A stretch beyond the merge influence area that is shorter is no segment of its own."""


def level_of_service(density_pc_mi_ln: float, kind: str, above_capacity: bool = False) -> str:
    """Returns the letter of a density: ``kind`` is ``basic`` or ``merge``."""
    if above_capacity:
        return "F"
    return next((a for a, most in LIMITS[kind] if density_pc_mi_ln <= most), "F")


class Segment(NamedTuple):
    """A stretch of the mainline; ``kind`` says which letters hold."""

    name: str
    kind: str
    start_m: float
    end_m: float


def segments_of(scenario: Scenario) -> list[Segment]:
    """Returns the segments of the mainline: upstream, merge influence area, and what is beyond."""
    mainline = scenario.mainline
    merge_end_m = min(MERGE_INFLUENCE_M, mainline.end_m)
    found = [
        Segment("upstream", BASIC, mainline.start_m, 0.0),
        Segment("merge influence area", MERGE, 0.0, merge_end_m),
    ]
    if mainline.end_m - merge_end_m >= SHORTEST_M:
        found.append(Segment("downstream", BASIC, merge_end_m, mainline.end_m))
    return found


def levels_table(motion: Motion, interval_s: float = INTERVAL_S) -> pl.DataFrame:
    """Returns one row a segment and interval, with the columns of ``LEVELS``."""
    edges_s = edges_of(motion, interval_s)
    _, broken = breakdowns(motion, edges_s)
    frames = []
    for segment in segments_of(motion.scenario):
        density_pc_km_ln, speed_mps = density_of(motion, segment, edges_s)
        density_pc_mi_ln = density_pc_km_ln * KM_PER_MI
        fails = broken if segment.start_m <= 0.0 else np.zeros(len(broken), np.bool_)
        frames.append(
            frame_of(
                LEVELS,
                segment=[segment.name] * len(broken),
                start_m=[segment.start_m] * len(broken),
                end_m=[segment.end_m] * len(broken),
                from_s=edges_s[:-1],
                to_s=edges_s[1:],
                density_pc_km_ln=density_pc_km_ln,
                density_pc_mi_ln=density_pc_mi_ln,
                mean_speed_mps=speed_mps,
                level_of_service=[
                    level_of_service(density, segment.kind, bool(fail))
                    for density, fail in zip(density_pc_mi_ln, fails, strict=True)
                ],
            )
        )
    return pl.concat(frames)


def density_of(
    motion: Motion, segment: Segment, edges_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Returns density (passenger cars per km and lane) and mean speed (m/s) by interval.

    The acceleration lane counts as a lane for as long as it is, with those who are on it. Of a
    merge influence area the two mainline lanes next to it count alone. Speeds are nan where nobody
    was.
    """
    heavy = is_heavy(motion)
    cars = np.where(heavy, CARS_PER_TRUCK, 1.0)
    lane_m, time_s, way_m = 0.0, np.zeros(len(edges_s) - 1), np.zeros(len(edges_s) - 1)
    weighted_s = np.zeros(len(edges_s) - 1)
    for road in _roads_of(motion.scenario, segment):
        edges_m = np.array([max(segment.start_m, road.start_m), min(segment.end_m, road.end_m)])
        if edges_m[0] >= edges_m[1]:
            continue
        lane_m += _lane_m(road, edges_m)
        on_road = road.pieces(motion)
        spent = spent_in_cells(motion, on_road, edges_s, edges_m)
        time_s += spent.time_s[:, 0]
        way_m += spent.way_m[:, 0]
        weighted_s += spent_in_cells(motion, on_road, edges_s, edges_m, cars).time_s[:, 0]
    speed_mps = np.full(len(time_s), np.nan)
    np.divide(way_m, time_s, out=speed_mps, where=time_s > 0.0)
    return weighted_s / (lane_m * np.diff(edges_s)) * 1000.0, speed_mps


def _roads_of(scenario: Scenario, segment: Segment) -> list[Road]:
    """The roads that count in a segment."""
    mainline = road_of(scenario, MAINLINE_ROAD)
    if segment.kind != MERGE:
        return [mainline]
    near = lanes_of(scenario)[:MERGE_INFLUENCE_LANES] or [mainline]
    return [*near, road_of(scenario, RAMP_ROAD)]


def _lane_m(road: Road, edges_m: FloatArray) -> float:
    return float(road.lanes * (edges_m[1] - edges_m[0]))


def is_heavy(motion: Motion) -> np.ndarray:
    """Returns which vehicles are heavy: of a type whose fuel is that of heavy-duty vehicles."""
    scenario = motion.scenario
    heavy = {n: scenario.type_named(n).fuel == "heavy-duty" for n in set(motion.vehicle_type)}
    return np.array([heavy[name] for name in motion.vehicle_type], np.bool_)
