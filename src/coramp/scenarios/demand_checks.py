"""What must fit together in demand over time and in detectors."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from coramp.road.streams import STREAMS
from coramp.scenarios.demand_sections import DemandPart

if TYPE_CHECKING:
    from coramp.scenarios.model import Scenario

SAME_S = 1e-6
SHARES_WITHIN = 1e-6

Numbered = tuple[int, DemandPart]


def demand_problems(scenario: "Scenario") -> list[str]:
    """Returns a line for each part of demand, or pair of them, that cannot be."""
    if problems := list(dict.fromkeys(_own_problems(scenario))):
        return problems
    for on_ramp, route in enumerate(STREAMS):
        here = [(k, part) for k, part in enumerate(scenario.demand) if part.route == route]
        lanes = {part.lane for _, part in here}
        if None in lanes and len(lanes) > 1:
            k = next(k for k, part in here if part.lane is None)
            problems.append(f"demand.{k}.lane: is missing; allowed is one in each part of {route}")
            continue
        for lane in lanes:
            own = [found for found in here if found[1].lane == lane]
            problems += _together(scenario, bool(on_ramp), own)
    return problems


def _own_problems(scenario: "Scenario") -> Iterator[str]:
    """What each part of demand has wrong by itself. Of counts it is told by road, not by part."""
    for k, part in enumerate(scenario.demand):
        where = f"demand.{k}." if scenario.counts is None else f"counts.{part.route}: "
        yield from (where + line for line in _part_problems(scenario, part))


def _part_problems(scenario: "Scenario", part: DemandPart) -> Iterator[str]:
    if part.end_s <= part.begin_s:
        yield f"end_s: {part.end_s:g} is not after begin_s; allowed is above {part.begin_s:g} s"
    if (part.flow_veh_h is None) == (part.vehicles is None):
        given = "neither it nor vehicles is" if part.vehicles is None else "it and vehicles are"
        yield f"flow_veh_h: {given} given; allowed is one of the two"
    types = [kind.name for kind in scenario.vehicle_types]
    known = f"allowed are {', '.join(types)}"
    if part.type is not None and part.type not in types:
        yield f"type: there is no {part.type!r}; {known}"
    if part.shares is not None:
        if part.type is not None:
            yield "shares: beside type; allowed is one of the two"
        yield from (f"shares: there is no {n!r}; {known}" for n in part.shares if n not in types)
        total = sum(part.shares.values())
        if abs(total - 1.0) > SHARES_WITHIN:
            yield f"shares: they sum to {total:g}; allowed is 1"
    lanes = scenario.mainline.lanes if part.route == STREAMS[0] else 1
    if part.lane is not None and part.lane >= lanes:
        yield f"lane: the {part.route} has no lane {part.lane}; allowed is up to {lanes - 1}"
    yield from _station_problems(scenario, part.route, part.station_m)


def _station_problems(scenario: "Scenario", route: str, station_m: float | None) -> Iterator[str]:
    """Vehicles must have entered there, and those of the ramp not have merged yet."""
    start_m = getattr(scenario, route).start_m
    end_m = scenario.mainline.end_m if route == STREAMS[0] else 0.0
    if scenario.counts is not None:
        end_m = 0.0  # behind the nose it counts those of the ramp as well
    if station_m is not None and not start_m <= station_m <= end_m:
        yield (
            f"station_m: {station_m:g} is not on the {route}; allowed is {start_m:g} to {end_m:g} m"
        )


def _together(scenario: "Scenario", on_ramp: bool, parts: Sequence[Numbered]) -> Iterator[str]:
    """Intervals of a lane are the same or do not overlap, and hold no more than fit."""
    headway_s = (scenario.ramp if on_ramp else scenario.mainline).min_headway_s
    if not on_ramp and parts[0][1].lane is None:
        headway_s *= max(scenario.mainline.shares)  # of the lane that most enter on
    ordered = sorted(parts, key=lambda found: (found[1].begin_s, found[1].end_s))
    (number, until), count = ordered[0], 0.0
    for k, part in ordered:
        same = (part.begin_s, part.end_s) == (until.begin_s, until.end_s)
        if not same and part.begin_s < until.end_s - SAME_S:
            yield (
                f"demand.{k}.begin_s: {part.begin_s:g} lies within demand.{number}, which has "
                f"another interval; allowed is {until.end_s:g} s or later, or the same interval"
            )
        if part.station_m != until.station_m and same:
            yield (
                f"demand.{k}.station_m: is not that of demand.{number}, at the same time; "
                "allowed is one station"
            )
        count = count + part.count if same else part.count
        number, until = k, part
        length_s = part.end_s - part.begin_s
        if count * headway_s > length_s:
            where = f"demand.{k}: "
            if scenario.counts is not None:
                where = f"counts.{part.route}: from {part.begin_s:g} to {part.end_s:g} s "
                where += "" if part.lane is None else f"on lane {part.lane} "
            yield (
                f"{where}{count:g} vehicles in {length_s:g} s cannot come with headways of "
                f"{headway_s:.2g} s or more; allowed are up to {int(length_s / headway_s)}"
            )


def detector_problems(scenario: "Scenario") -> list[str]:
    """Returns a line for each detector that cannot be where it is said to be."""
    problems = []
    names = [detector.id for detector in scenario.detector]
    for k, detector in enumerate(scenario.detector):
        if detector.id in names[:k]:
            problems.append(f"detector.{k}.id: {detector.id!r} is given twice; allowed is once")
        start_m = getattr(scenario, detector.road).start_m
        end_m = scenario.mainline.end_m
        if detector.road == STREAMS[1]:
            end_m = scenario.ramp.acceleration_lane_m
        if not start_m < detector.station_m < end_m:
            problems.append(
                f"detector.{k}.station_m: {detector.station_m:g} is not on the {detector.road}; "
                f"allowed is between {start_m:g} and {end_m:g} m"
            )
    return problems
