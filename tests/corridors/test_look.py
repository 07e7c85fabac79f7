"""Who is in which zone: as arrays of all zones at once, and against one vehicle after the other."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from coramp.networks.limits import Limits
from coramp.scenarios.corridors import load_corridor
from coramp.worlds.sumo.corridor import Coordination, _planned
from coramp.worlds.sumo.corridor_look import Found, placed_of, zone_lanes_of, zone_limits_of
from coramp.worlds.sumo.corridor_record import PASSAGE, CorridorRecord
from coramp.worlds.sumo.corridor_road import corridor_road
from coramp.worlds.sumo.network import RAMP_LANE
from tests.corridors import written

BYTES_A_VEHICLE_AT_MOST = 800
SLOWER_AHEAD = (
    (Limits((-900.0, -60.0, 80.0), (27.78, 15.0, 25.0)), Limits((-900.0, 0.0), (22.22, 27.78))),
    (Limits((-900.0,), (27.78,)), Limits((-900.0, -50.0, 10.0, 60.0), (22.22, 12.0, 9.0, 30.0))),
)
"""Along mainline and ramp of each site."""


@pytest.fixture(scope="module")
def corridor(tmp_path_factory, network):
    """The road of two sites."""
    return load_corridor(written(tmp_path_factory.mktemp("look"), network))


def with_limits(site, mainline, ramp):
    """Returns a site with other limits along its ways."""
    ways = site.road.mainline._replace(limits=mainline), site.road.ramp._replace(limits=ramp)
    return replace(site, road=replace(site.road, mainline=ways[0], ramp=ways[1]))


def found_at(places, positions_m):
    count = len(places)
    names = [f"v{k}" for k in range(count)]
    return Found(names, np.arange(count), np.array(places), positions_m, np.full(count, 20.0))


def test_each_vehicle_is_placed_as_it_would_be_alone(corridor):
    road, random = corridor_road(corridor), np.random.default_rng(1)
    sites = [with_limits(own, *pair) for own, pair in zip(road.sites, SLOWER_AHEAD, strict=True)]
    lanes, limits = zone_lanes_of(sites, road.lanes), zone_limits_of(sites)
    places = random.integers(0, len(road.lanes), 400)
    positions_m = random.uniform(0.0, 800.0, 400)
    placed = placed_of(lanes, limits, found_at(places, positions_m))
    seen = []
    for k, own in enumerate(sites):
        for i, (place, at_m) in enumerate(zip(places.tolist(), positions_m.tolist(), strict=True)):
            span = own.lanes.get(road.lanes[place])
            if span is None:
                continue
            station_m, on_ramp = span.start_m + at_m * span.per_m, span.lane == RAMP_LANE
            if own.from_m(on_ramp) <= station_m < own.zone.sees_m:
                allowed_mps = own.limits(on_ramp).allowed_mps(station_m)
                seen.append((k, i, station_m, span.lane, span.changes, allowed_mps))
    assert len({row[0] for row in seen}) == 2
    assert len({row[5] for row in seen}) > 10  # those who slow down for a limit ahead
    columns = (
        placed.site, placed.place, placed.station_m, placed.lane, placed.beside, placed.allowed_mps
    )  # fmt: skip
    assert list(zip(*(column.tolist() for column in columns), strict=True)) == seen
    ends_m = np.array([own.zone.to_m for own in sites])
    assert (placed.inside == (placed.station_m < ends_m[placed.site])).all()
    assert 0 < placed.inside.sum() < len(placed.inside)
    assert placed.entry_of(1, int(placed.place[-1])) == len(placed.place) - 1
    assert placed.entry_of(0, 400) is None


def noted(record, now_s, site, number, speed_mps):
    count = len(number)
    site, number = np.array(site, np.int64), np.array(number, np.int64)
    gone = record.gone(site, number)
    for n, k in gone:
        record.leave(now_s, k, n, 0.0)
    lane, there_m = np.zeros(count, np.int64), np.zeros(count)
    record.look(now_s, site, number, lane, np.full(count, speed_mps), there_m)
    return gone


def test_who_goes_from_one_zone_to_the_next_passes_both():
    record = CorridorRecord(3, 0.2)
    assert noted(record, 0.2, [0, 0], [0, 2], 20.0) == []
    assert noted(record, 0.4, [0, 1], [2, 0], 19.0) == [(0, 0)]
    assert record.site_of(np.array([0, 1, 2])).tolist() == [1, -1, 0]
    assert noted(record, 0.6, [1], [0], 19.0) == [(2, 0)]
    record.end()
    rows = record.table(record.passages, PASSAGE)
    assert rows["site"].tolist() == [0.0, 0.0, 1.0]
    assert rows["number"].tolist() == [0.0, 2.0, 0.0]
    assert rows["entered_s"].tolist() == [0.2, 0.2, 0.4]
    assert rows["left_s"][:2].tolist() == [0.4, 0.6]
    assert np.isnan(rows["left_s"][2])
    assert rows["hard_brakings"].tolist() == [0.0, 1.0, 0.0]  # 1 m/s in 0.2 s, within one zone


def kept_bytes(corridor, horizon_s):
    """Returns how much a run keeps before it begins, and how many vehicles will come."""
    simulation = {"horizon_s": horizon_s}
    tracemalloc.start()
    update = {"simulation": corridor.common.simulation.model_copy(update=simulation)}
    scenarios = tuple(own.model_copy(update=update) for own in corridor.scenarios)
    longer = type(corridor)(
        corridor.name, corridor.section, corridor.roads, scenarios, corridor.zones
    )
    coordination = Coordination("mixed-slots", 0.2, 1)
    planned = _planned(longer, coordination, longer.common.drivers["credible"], 1)
    with planned.sites_running(coordination):
        kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return kept, len(planned.automated)


def test_a_vehicle_that_is_yet_to_come_takes_some_hundred_bytes(corridor):
    kept_bytes(corridor, 10.0)  # what is made once
    (few_bytes, few), (many_bytes, many) = (kept_bytes(corridor, s) for s in (300.0, 3000.0))
    assert many > few + 1000
    assert (many_bytes - few_bytes) / (many - few) < BYTES_A_VEHICLE_AT_MOST
