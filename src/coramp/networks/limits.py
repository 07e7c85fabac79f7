"""Speed limits along the two roads of a merge site, lanes inside junctions included."""

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

from coramp.networks.course import Course
from coramp.networks.ramps import OnRamp

SLOWS_MPS2 = 1.5
"""With this a vehicle slows down for a lower limit ahead."""


@dataclass(frozen=True)
class Limits:
    """Speed limits of a road: from each station ``from_m`` on, up to the next; both ascend.

    Where lanes differ, the lowest counts.
    """

    from_m: tuple[float, ...]
    limit_mps: tuple[float, ...]

    def allowed_mps(self, station_m: float) -> float:
        """Returns the speed at a station that keeps to the limit there and to all ahead."""
        here = max(0, bisect_right(self.from_m, station_m) - 1)
        ahead = zip(self.from_m[here + 1 :], self.limit_mps[here + 1 :], strict=True)
        allowed = (
            math.sqrt(limit**2 + 2.0 * SLOWS_MPS2 * (from_m - station_m)) for from_m, limit in ahead
        )
        return min((self.limit_mps[here], *allowed))


def limits_along(ramp: OnRamp, on_ramp: bool) -> Limits:
    """Returns the limits of the ramp or the mainline before the nose, and behind it."""
    before = ramp.ramp if on_ramp else ramp.mainline
    nose = ramp.ramp_way if on_ramp else ramp.mainline_way
    start_m = -nose.length_m - before.length_m
    found = list(_of_course(before, start_m))
    found += [(-nose.length_m, min((lane.limit_mps for lane in nose.inside), default=math.inf))]
    found += list(_of_course(ramp.downstream, 0.0))
    kept: list[tuple[float, float]] = []
    for from_m, limit in found:
        if math.isfinite(limit) and (not kept or kept[-1][1] != limit):
            kept.append((from_m, limit))
    return Limits(tuple(at for at, _ in kept), tuple(limit for _, limit in kept))


def _of_course(course: Course, start_m: float) -> Iterator[tuple[float, float]]:
    for k, edge in enumerate(course.edges):
        yield start_m, min(lane.limit_mps for lane in edge.lanes)
        start_m += edge.length_m
        if k < len(course.crossings):
            crossing = course.crossings[k]
            inside = [lane.limit_mps for way in crossing.ways for lane in way.inside]
            yield start_m, min(inside, default=math.inf)
            start_m += crossing.length_m
