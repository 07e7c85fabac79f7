"""Mean speed over time and way along the roads of a corridor, from SUMO's positions."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.networks.graph import Network
from coramp.networks.roads import ThroughRoad
from coramp.records.corridor_run import CorridorRecords
from coramp.scenarios.corridors import network_of

CELL_M = 50.0
CELL_S, SHORT_CELL_S = 30.0, 10.0
SHORT_S = 600.0
"""Runs up to this long have shorter cells of time."""
LOOK_S = 1.0
"""Positions are read about this often."""


class RoadContour(NamedTuple):
    """The mean speed (m/s) on all lanes of a road, by interval and stretch; nan where nobody was.

    ``edges_m`` count from the road's upstream end; ``noses_m`` are those of its sites.
    """

    number: int
    noses_m: tuple[float, ...]
    edges_s: FloatArray
    edges_m: FloatArray
    speed_mps: FloatArray
    free_mps: float


def contours_of(records: CorridorRecords) -> list[RoadContour]:
    """Returns the contour of each road of a corridor's run.

    Raises CorampError where no network was kept, or it cannot be read. Empty where no positions
    were kept.
    """
    if not records.has_positions:
        return []
    corridor = records.corridor()
    network = network_of(corridor)
    lanes = [dict(_lanes(network, road)) for road in corridor.roads]
    seen = _seen(records, lanes)
    until_s = float(records.summary["until_s"])
    cell_s = SHORT_CELL_S if until_s <= SHORT_S else CELL_S
    return [
        _contour(number, road, seen.filter(road=number), np.arange(0.0, until_s + cell_s, cell_s))
        for number, road in enumerate(corridor.roads, 1)
    ]


def _seen(records: CorridorRecords, lanes: list[dict[str, float]]) -> pl.DataFrame:
    """Where on which road somebody was, how fast, about once a second."""
    road_of = {lane: number for number, own in enumerate(lanes, 1) for lane in own}
    starts_m = {lane: start_m for own in lanes for lane, start_m in own.items()}
    lane = pl.col("lane")
    return (
        records.positions(max(1, round(LOOK_S / records.step_s)))
        .filter(lane.is_in(list(road_of)))
        .select(
            "vehicle_id",
            road=lane.replace_strict(road_of, return_dtype=pl.Int64),
            time_s=pl.col("step") * records.step_s,
            way_m=lane.replace_strict(starts_m, return_dtype=pl.Float64) + pl.col("pos"),
            speed_mps="speed",
        )
        .collect()
    )


def _contour(
    number: int, road: ThroughRoad, seen: pl.DataFrame, edges_s: FloatArray
) -> RoadContour:
    way_m = seen["way_m"].to_numpy()
    end_m = max(road.starts_m[-1], float(way_m.max(initial=0.0)))
    edges_m = np.arange(0.0, end_m + CELL_M, CELL_M)
    at = (seen["time_s"].to_numpy(), way_m)
    sums, _, _ = np.histogram2d(*at, (edges_s, edges_m), weights=seen["speed_mps"].to_numpy())
    counts, _, _ = np.histogram2d(*at, (edges_s, edges_m))
    mean_mps = np.full(sums.shape, np.nan)
    np.divide(sums, counts, out=mean_mps, where=counts > 0.0)
    noses_m = tuple(road.nose_m(site) for site in road.sites)
    free_mps = max(road.limits.limit_mps)
    return RoadContour(number, noses_m, edges_s, edges_m, mean_mps, free_mps)


def _lanes(network: Network, road: ThroughRoad) -> Iterator[tuple[str, float]]:
    """Each lane of a road with the way (m) at which it begins, those inside junctions included."""
    for edge_id, start_m in zip(road.edges, road.starts_m, strict=True):
        yield from ((lane.lane_id, start_m) for lane in network.edges[edge_id].lanes)
    for (edge_id, following), start_m in zip(pairwise(road.edges), road.starts_m, strict=False):
        for way in network.between(edge_id, following):
            inside_m = start_m + network.edges[edge_id].length_m
            for lane in way.inside:
                yield lane.lane_id, inside_m
                inside_m += lane.length_m
