"""An outside look at a run in a network: SUMO's own files, read by code that shares nothing."""

import gzip
import xml.etree.ElementTree as ET
from itertools import pairwise

import polars as pl

EXACT_M = 0.01


def lengths_m(routes):
    """The length (m) of each vehicle, from the route file."""
    root = ET.parse(routes).getroot()
    kinds = {kind.get("id"): float(kind.get("length")) for kind in root.iter("vType")}
    return {v.get("id"): kinds[v.get("type")] for v in root.iter("vehicle")}


def positions(folder):
    """Time, vehicle, lane and position of each sample of a run that kept SUMO's files."""
    frame = pl.read_parquet(folder / "sumo" / "fcd.parquet").drop_nulls("vehicle_id")
    return frame.sort("timestep_time", "vehicle_lane", "vehicle_pos")


def overlaps(folder):
    """Pairs that overlap on a lane at any step: time, rear vehicle, front vehicle."""
    length_m = lengths_m(folder / "sumo" / "routes.rou.xml")
    found = []
    for (time_s, _), on_lane in positions(folder).group_by("timestep_time", "vehicle_lane"):
        order = sorted(zip(on_lane["vehicle_pos"], on_lane["vehicle_id"], strict=True))
        for (rear_m, rear), (front_m, front) in pairwise(order):
            if front_m - length_m[front] - rear_m < -EXACT_M:
                found.append((time_s, rear, front))
    return found


def lane_changes(folder):
    """Changes from one lane of an edge to another: time, vehicle, edge, from index, to index."""
    found = []
    frame = positions(folder).sort("vehicle_id", "timestep_time")
    rows = zip(frame["vehicle_id"], frame["vehicle_lane"], frame["timestep_time"], strict=True)
    for (before, lane, _), (own, then, time_s) in pairwise(rows):
        (edge, index), (edge_then, index_then) = lane.rsplit("_", 1), then.rsplit("_", 1)
        if before == own and edge == edge_then and index != index_then:
            found.append((time_s, own, edge, int(index), int(index_then)))
    return found


def lanes_of(network):
    """The lengths (m) of a network's lanes, by id."""
    raw = network.read_bytes()
    root = ET.fromstring(gzip.decompress(raw) if raw[:2] == b"\x1f\x8b" else raw)
    return {lane.get("id"): float(lane.get("length")) for lane in root.iter("lane")}


def too_near(folder, chosen, braking_mps2):
    """Pairs of which the rear one, one of those chosen, could not stop behind a front that brakes.

    Both brake alike: gap + v_f^2 / 2b < v_r^2 / 2b. Time, rear and front vehicle, and what is
    missing (m).
    """
    length_m = lengths_m(folder / "sumo" / "routes.rou.xml")
    found = []
    columns = ("vehicle_pos", "vehicle_speed", "vehicle_id")
    for (time_s, _), on_lane in positions(folder).group_by("timestep_time", "vehicle_lane"):
        for (rear_m, rear_mps, rear), (front_m, front_mps, front) in pairwise(
            sorted(on_lane.select(columns).iter_rows())
        ):
            gap_m = front_m - length_m[front] - rear_m
            left_m = gap_m + (front_mps**2 - rear_mps**2) / (2.0 * braking_mps2)
            if rear in chosen and left_m < 0.0:
                found.append((time_s, rear, front, left_m))
    return found
