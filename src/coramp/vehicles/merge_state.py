"""How a vehicle comes onto the mainline: by the mainline itself, by a planned merge, or not yet.

A merge time alone tells which. It is a time (s) where a merge is planned, ``BY_MAINLINE_S`` where
a vehicle was on the mainline before it entered, and ``NOT_PLANNED_S`` where a ramp vehicle has no
committed merge and ends in a stop. The last two are no times, and are chosen so that "on the
mainline from its merge time on" holds for every vehicle. Only this module compares with them; the
checker has words of its own (``checker.merging``).
"""

import math

from coramp._kernel import kernel_part

BY_MAINLINE_S = -math.inf
"""The merge time of a vehicle that came by the mainline."""
NOT_PLANNED_S = math.inf
"""The merge time of a ramp vehicle without a committed merge."""


@kernel_part
def merge_time_at_entry_s(on_ramp: bool) -> float:
    """Returns the merge time with which a vehicle of a stream enters."""
    return NOT_PLANNED_S if on_ramp else BY_MAINLINE_S


@kernel_part
def came_by_mainline(merge_s: float) -> bool:
    """Returns whether a vehicle came by the mainline."""
    return merge_s == BY_MAINLINE_S


@kernel_part
def is_planned(merge_s: float) -> bool:
    """Returns whether a ramp vehicle has a committed merge, which may lie in the past."""
    return BY_MAINLINE_S < merge_s < NOT_PLANNED_S


@kernel_part
def is_waiting(merge_s: float) -> bool:
    """Returns whether a ramp vehicle has no committed merge."""
    return merge_s == NOT_PLANNED_S


@kernel_part
def has_place_on_mainline(merge_s: float) -> bool:
    """Returns whether a vehicle is or will be on the mainline: it came by it, or is to merge."""
    return merge_s < NOT_PLANNED_S


@kernel_part
def is_on_mainline(merge_s: float, time_s: float) -> bool:
    """Returns whether a vehicle is on the mainline at a time."""
    return merge_s <= time_s


@kernel_part
def is_yet_to_merge(merge_s: float, time_s: float) -> bool:
    """Returns whether a vehicle is on the ramp at a time and has a merge planned for later."""
    return time_s < merge_s < NOT_PLANNED_S
