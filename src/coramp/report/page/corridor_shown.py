"""A corridor's run as its replay takes it: lanes as they lie, and where each vehicle was."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.networks.graph import Lane, Network
from coramp.records.corridor_run import CorridorRecords
from coramp.records.run_folder import SUMO
from coramp.records.schemas import Row
from coramp.report.page.corridor_page import title_of
from coramp.scenarios.corridors import Corridor, network_of

PERIODS_S = (0.5, 1.0, 2.0)
"""How far apart in time the positions that a page has may lie."""
MOST_SAMPLES = 400_000
"""So many positions a page has at most: some megabytes."""
TENTHS = 10.0
"""Positions are whole decimetres, speeds whole tenths of a metre a second."""
ROUTES = "routes.rou.xml"
TYPE = re.compile(r'<vType id="([^"]+)"[^>]*? length="([^"]+)"')
DIGITS = 2


def corridor_data(records: CorridorRecords) -> Row:
    """Returns what the page's scripts take for a run; times in s, lengths in m.

    ``x`` and ``y`` of a vehicle are those of its front in decimetres, ``angle`` is in degrees from
    east, anticlockwise, ``speed`` in 0.1 m/s; each is the first value and then differences, one
    each ``period_s`` from ``from`` periods on. ``zones`` are the times in which a coordinator had
    it. Raises CorampError where no positions were kept.
    """
    seen, period_s, until_s = _seen(records)
    corridor = records.corridor()
    lanes = list(_lanes(network_of(corridor), corridor, seen["lane"].unique().to_list()))
    centre = _centre(lanes)
    return {
        "title": title_of(records),
        "end_s": until_s,
        "cut": until_s < float(records.summary["until_s"]),
        "period_s": period_s,
        "v0_mps": max(max(road.limits.limit_mps) for road in corridor.roads),
        "shapes": [{"width": lane.width_m, "xy": _turned(lane.shape_m, centre)} for lane in lanes],
        "sites": list(_sites(corridor, centre)),
        **_vehicles(records, seen, centre, corridor.common.usual_length_m),
    }


def _seen(records: CorridorRecords) -> tuple[pl.DataFrame, float, float]:
    """Positions at the shortest period of which a page has room; and until when (s)."""
    every = [max(1, round(period_s / records.step_s)) for period_s in PERIODS_S]
    counts = records.positions().group_by("step").len().sort("step").collect()
    chosen = next((k for k in every if _at(counts, k)["len"].sum() <= MOST_SAMPLES), every[-1])
    shown = _at(counts, chosen).filter(pl.col("len").cum_sum() <= MOST_SAMPLES)
    period_s, until_s = chosen * records.step_s, float(records.summary["until_s"])
    last = int(shown["step"].max() or 0)  # type: ignore[arg-type]
    seen = (
        records.positions(chosen)
        .filter(pl.col("step") <= last)
        .with_columns(at=pl.col("step") // chosen)
        .collect()
    )
    whole = shown.height == _at(counts, chosen).height
    return seen, period_s, until_s if whole else last * records.step_s


def _at(counts: pl.DataFrame, every: int) -> pl.DataFrame:
    """How many vehicles there are at each so many steps."""
    return counts.filter(pl.col("step") % every == 0)


def _lanes(network: Network, corridor: Corridor, used: list[str]) -> Iterator[Lane]:
    """All lanes of the edges of the roads and of those on which somebody was, and in between."""
    edges = dict.fromkeys(edge_id for road in corridor.roads for edge_id in road.edges)
    own = set(used)
    edges |= dict.fromkeys(lane.rpartition("_")[0] for lane in sorted(own))
    for edge_id in edges:
        if edge_id in network.edges:
            yield from network.edges[edge_id].lanes
    for way in network.connections:
        on_roads = way.from_edge in edges and way.to_edge in edges
        yield from (lane for lane in way.inside if on_roads or lane.lane_id in own)


def _centre(lanes: list[Lane]) -> tuple[float, float]:
    points = np.array([point for lane in lanes for point in lane.shape_m]).reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    return float(0.5 * (low[0] + high[0])), float(0.5 * (low[1] + high[1]))


def _turned(points: tuple[tuple[float, float], ...], centre: tuple[float, float]) -> list[float]:
    """Points from the centre of all, x and y in turn."""
    return [
        round(value - middle, DIGITS)
        for point in points
        for value, middle in zip(point, centre, strict=True)
    ]


def _sites(corridor: Corridor, centre: tuple[float, float]) -> Iterator[Row]:
    for number, site in enumerate(corridor.sites, 1):
        x, y = site.merge_edge.lanes[0].shape_m[0]
        yield {
            "name": f"site {number}: {site.ramp_id}",
            "x": round(x - centre[0], DIGITS),
            "y": round(y - centre[1], DIGITS),
        }


def _vehicles(
    records: CorridorRecords, seen: pl.DataFrame, centre: tuple[float, float], usual_m: float
) -> Row:
    """Each vehicle that drove: who it is, and its positions."""
    trips = records.frames["trips"]
    facts = {row["vehicle_id"]: row for row in trips.iter_rows(named=True)}
    lengths_m = _lengths_m(records.folder)
    zones = _zones(records.frames["hand_overs"], float(records.summary["until_s"]))
    rows = []
    for (name,), own in seen.sort("at", maintain_order=True).group_by(
        "vehicle_id", maintain_order=True
    ):
        east = 90.0 - own["angle"].to_numpy()
        rows.append(
            {
                "id": name,
                "automated": bool(facts[str(name)]["automated"]),
                "length": lengths_m.get(str(own["type"][0]), usual_m),
                "from": int(own["at"][0]),
                "x": _deltas((own["x"].to_numpy() - centre[0]) * TENTHS),
                "y": _deltas((own["y"].to_numpy() - centre[1]) * TENTHS),
                "angle": _deltas(np.degrees(np.unwrap(np.radians(east)))),
                "speed": _deltas(own["speed"].to_numpy() * TENTHS),
                "zones": zones.get(str(name), []),
            }
        )
    entered = trips["entered_s"].fill_null(float("inf"))
    outside = trips.filter(entered > trips["scheduled_s"] + 0.05)
    return {
        "vehicles": rows,
        "waits": [[row["scheduled_s"], row["entered_s"]] for row in outside.iter_rows(named=True)],
    }


def _deltas(values: FloatArray) -> list[int]:
    whole = np.rint(values).astype(np.int64)
    return [int(v) for v in np.diff(whole, prepend=0)]


def _zones(hand_overs: pl.DataFrame, end_s: float) -> dict[str, list[list[float]]]:
    """By vehicle the times (s) from which and until which a coordinator had it."""
    found: dict[str, list[list[float]]] = {}
    for row in hand_overs.sort("time_s", maintain_order=True).iter_rows(named=True):
        own = found.setdefault(row["vehicle_id"], [])
        if row["event"] == "enters":
            own.append([round(row["time_s"], 1), end_s])
        elif own:
            own[-1][1] = round(row["time_s"], 1)
    return found


def _lengths_m(folder: Path) -> Mapping[str, float]:
    """The length of each of SUMO's vehicle types; empty where its routes are gone."""
    try:
        text = (folder / SUMO / ROUTES).read_text(encoding="utf-8")
    except OSError:
        return {}
    return {name: float(length) for name, length in TYPE.findall(text)}
