"""The part of a merge site along which the mainline keeps its lanes."""

from dataclasses import replace

from coramp.networks.course import Course
from coramp.networks.ramps import OnRamp

ROUNDING_M = 1e-6


def on_steady_mainline(ramp: OnRamp) -> OnRamp:
    """Returns an on-ramp whose mainline begins and ends where its number of lanes changes.

    Before the nose that is behind another ramp's acceleration lane, for example; behind the nose it
    is at the end of the edge before the change, and not on the acceleration lane.
    """
    lanes = len(ramp.mainline_edge.lanes)
    return replace(
        ramp,
        mainline=_steady_before(ramp.mainline, lanes),
        downstream=_steady_behind(ramp, lanes),
    )


def _steady_before(course: Course, lanes: int) -> Course:
    first = len(course.edges) - 1
    while first > 0 and len(course.edges[first - 1].lanes) == lanes:
        if len({way.to_lane - way.from_lane for way in course.crossings[first - 1].ways}) > 1:
            break  # lanes that cross over
        first -= 1
    return Course(course.edges[first:], course.crossings[first:])


def _steady_behind(ramp: OnRamp, lanes: int) -> Course:
    course, own_m = ramp.downstream, 0.0
    for k, edge in enumerate(course.edges):
        beyond = own_m >= (ramp.merging.lane_m or 0.0) - ROUNDING_M
        if beyond and k > 0 and len(edge.lanes) != lanes:
            return Course(course.edges[:k], course.crossings[: k - 1])
        own_m += edge.length_m
        if k < len(course.crossings):
            own_m += 0.0 if beyond else course.crossings[k].length_m
    return course
