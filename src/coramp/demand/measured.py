"""Vehicles drawn so that counts are met exactly: seeds differ in when they come, not in how many.

In each interval as many vehicles of each type pass a station as were counted there. They enter
earlier, by the time that they take to it undisturbed.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from coramp._kernel import FloatArray
from coramp.demand.generators import generator
from coramp.demand.passing import Clock, Stream
from coramp.errors import CorampError
from coramp.networks.limits import limits_along
from coramp.road.streams import STREAMS
from coramp.scenarios.demand_sections import DemandPart
from coramp.scenarios.model import Scenario
from coramp.scenarios.network_section import site_of
from coramp.scenarios.vehicle_types import VehicleType

Name = TypeVar("Name", int, str)
FREE_MPS2 = 2.0
"""About how hard vehicles speed up from where they enter."""


class Group(NamedTuple):
    """What comes within one interval on one lane: how many vehicles of each type."""

    begin_s: float
    end_s: float
    lane: int
    station_m: float
    counts: dict[str, int]


class Drawn(NamedTuple):
    """One vehicle: the step at which it enters, entry speed, type, own top speed, lane."""

    step: int
    speed_mps: float
    kind: VehicleType
    top_mps: float
    lane: int


def drawn_arrivals(scenario: Scenario, on_ramp: bool, seed: int) -> list[Drawn]:
    """Returns the vehicles that come by a route before the horizon, lane by lane, by time."""
    groups = groups_of(scenario, on_ramp)
    step_s, horizon_s = scenario.control.step_s, scenario.simulation.horizon_s
    drawn: list[Drawn] = []
    for lane in sorted({group.lane for group in groups}):
        own = [group for group in groups if group.lane == lane]
        drawn += _of_lane(scenario, on_ramp, own, seed)
    return [one for one in drawn if one.step * step_s < horizon_s - 1e-9]


def groups_of(scenario: Scenario, on_ramp: bool) -> list[Group]:
    """Returns the demand of a route by interval and lane, with whole numbers of each type.

    A fraction of a vehicle is carried on to the next interval, so that sums stay. What is not said
    to enter on a lane is shared out to all as the scenario's shares of lanes say.
    """
    route = STREAMS[on_ramp]
    start_m = getattr(scenario, route).start_m
    carried: dict[tuple[str, int | str | None], dict[Any, float]] = {}
    found: dict[tuple[float, float, int], Group] = {}
    parts = [part for part in scenario.demand if part.route == route]
    for part in sorted(parts, key=lambda part: (part.begin_s, part.lane or 0)):
        station_m = start_m if part.station_m is None else part.station_m
        shares = _shares(scenario, on_ramp, part)
        rest = carried.setdefault(("type", part.lane), {})
        for name, count in shared_out(part.count, part.vehicles, shares, rest).items():
            rest = carried.setdefault(("lane", name), {})
            lanes = _lanes(scenario, on_ramp, part)
            for lane, here in shared_out(count, count, lanes, rest).items():
                group = Group(part.begin_s, part.end_s, lane, station_m, {})
                counts = found.setdefault((part.begin_s, part.end_s, lane), group).counts
                counts[name] = counts.get(name, 0) + here
    return [found[key] for key in sorted(found) if any(found[key].counts.values())]


def _shares(scenario: Scenario, on_ramp: bool, part: DemandPart) -> Mapping[str, float]:
    """Which share each type has of a part of demand."""
    if part.type is not None:
        return {part.type: 1.0}
    if part.shares is not None:
        return part.shares
    return {kind.name: kind.share_of(on_ramp) for kind in scenario.vehicle_types}


def _lanes(scenario: Scenario, on_ramp: bool, part: DemandPart) -> Mapping[int, float]:
    """Which share of a part of demand enters on each lane."""
    if part.lane is not None or on_ramp:
        return {part.lane or 0: 1.0}
    return dict(enumerate(scenario.mainline.shares))


def shared_out(
    count: float, total: int | None, shares: Mapping[Name, float], carried: dict[Name, float]
) -> dict[Name, int]:
    """Returns how many of ``count`` vehicles each has by its share: whole numbers.

    They sum to ``total``; left out, to the count as near as whole numbers are. ``carried`` is what
    is left over of each, from before, and is changed.
    """
    exact = {name: share * count + carried.get(name, 0.0) for name, share in shares.items()}
    if total is None:
        total = max(0, math.floor(sum(exact.values()) + 0.5 - 1e-9))
    whole = {name: max(0, math.floor(value + 1e-9)) for name, value in exact.items()}
    left = total - sum(whole.values())
    by_rest = sorted(exact, key=lambda name: whole[name] - exact[name])
    for k in range(abs(left)):
        if left > 0:
            whole[by_rest[k % len(by_rest)]] += 1
        else:
            whole[max(whole, key=lambda name: whole[name])] -= 1
    carried.update({name: exact[name] - whole[name] for name in exact})
    return whole


def _of_lane(
    scenario: Scenario, on_ramp: bool, groups: Sequence[Group], seed: int
) -> Iterator[Drawn]:
    road = scenario.ramp if on_ramp else scenario.mainline
    lane = groups[0].lane
    name = STREAMS[on_ramp] + (f"/lane {lane}" if lane else "")
    purposes = ("arrivals", "order of types", "entry speeds", "top speeds")
    draws = {purpose: generator(seed, f"{purpose}/{name}") for purpose in purposes}
    clock = Clock(scenario.control.step_s, road.min_headway_s)
    for group in groups:
        kinds = [scenario.type_named(name) for name, n in group.counts.items() for _ in range(n)]
        kinds = [kinds[k] for k in draws["order of types"].permutation(len(kinds))]
        tops_mps = _top_speeds_mps(kinds, draws["top speeds"].random(len(kinds)))
        speeds_mps = draws["entry speeds"].uniform(*road.entry_speed_mps, len(kinds))
        stream = _stream(scenario, on_ramp, group.station_m, kinds, speeds_mps, tops_mps)
        _check_in_time(scenario, on_ramp, group, stream)
        steps, stream = clock.placed(group.begin_s, group.end_s, stream, draws["arrivals"])
        for step, k in zip(steps.tolist(), stream.number.tolist(), strict=True):
            yield Drawn(step, float(speeds_mps[k]), kinds[k], float(tops_mps[k]), lane)


def _check_in_time(scenario: Scenario, on_ramp: bool, group: Group, stream: Stream) -> None:
    """Raises CorampError where the first who enter reach a station only behind their interval."""
    road = scenario.ramp if on_ramp else scenario.mainline
    first_s, count = float(stream.way_s.min()), len(stream.number)
    if first_s + (count - 1) * road.min_headway_s < group.end_s:
        return
    where = f"demand on the {STREAMS[on_ramp]}"
    if scenario.counts is not None:
        where = f"counts.{STREAMS[on_ramp]}"
    raise CorampError(
        f"{where}: {count} vehicles are to pass {group.station_m:g} m by {group.end_s:g} s, "
        f"and the first takes {first_s:.1f} s from its entry at {road.start_m:g} m; allowed are "
        "a station nearer to the entry, or a longer first interval"
    )


def _top_speeds_mps(kinds: Sequence[VehicleType], draws: FloatArray) -> FloatArray:
    ranges = [kind.top_speeds_mps for kind in kinds]
    return np.array(
        [
            high if math.isinf(high) else low + draw * (high - low)
            for (low, high), draw in zip(ranges, draws.tolist(), strict=True)
        ]
    )


def _stream(
    scenario: Scenario,
    on_ramp: bool,
    station_m: float,
    kinds: Sequence[VehicleType],
    speeds_mps: FloatArray,
    tops_mps: FloatArray,
) -> Stream:
    start_m = (scenario.ramp if on_ramp else scenario.mainline).start_m
    lengths_m = np.array([kind.length_m for kind in kinds])
    entry_mps = np.minimum(speeds_mps, tops_mps)
    way_s = np.zeros(len(kinds))
    if station_m > start_m:
        way_m = station_m - start_m + lengths_m
        way_s = undisturbed_s(scenario, on_ramp, way_m, entry_mps, tops_mps)
    return Stream(np.arange(len(kinds)), lengths_m, entry_mps, way_s)


def undisturbed_s(
    scenario: Scenario, on_ramp: bool, way_m: FloatArray, entry_mps: FloatArray, top_mps: FloatArray
) -> FloatArray:
    """Returns how long (s) vehicles take for ``way_m`` from their entry, undisturbed.

    Drivers whose wish is their entry speed keep it. All others soon drive as fast as is usual on
    their road, v0 or v_R0, or at their own top speed.
    """
    drivers = scenario.drivers.get(scenario.traffic.drivers)
    if drivers is not None and drivers.wish == "entry-speed":
        return np.asarray(way_m / entry_mps)
    start_m = (scenario.ramp if on_ramp else scenario.mainline).start_m
    total_s = np.zeros(len(way_m))
    stretches = speeds_along(scenario, on_ramp)
    for from_m, to_m, usual_mps in stretches:
        on_it_m = np.clip(start_m + way_m, from_m, to_m) - from_m
        total_s += on_it_m / np.minimum(usual_mps, top_mps)
    first_mps = np.minimum(stretches[0][2], top_mps)
    away_mps = first_mps - entry_mps
    return total_s + np.sign(away_mps) * away_mps**2 / (2.0 * FREE_MPS2 * first_mps)


def speeds_along(scenario: Scenario, on_ramp: bool) -> list[tuple[float, float, float]]:
    """Returns stretches of a road (m), and how fast vehicles usually drive on each (m/s).

    On coramp's own roads that is v0 or v_R0; in a network its limits bind as well.
    """
    road = scenario.ramp if on_ramp else scenario.mainline
    if scenario.network is None:
        return [(road.start_m, math.inf, road.speed_mps)]
    limits = limits_along(site_of(scenario.network), on_ramp)
    ends_m = [*limits.from_m[1:], math.inf]
    v0 = scenario.mainline.speed_mps
    found = [
        (max(from_m, road.start_m), to_m, min(limit_mps, v0))
        for from_m, to_m, limit_mps in zip(limits.from_m, ends_m, limits.limit_mps, strict=True)
    ]
    return [stretch for stretch in found if stretch[1] > stretch[0]]
