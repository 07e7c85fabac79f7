"""The lane history of a run: who was on which lane from when to when.

There is one of a run. Plans change lanes once, at the merge time that the ledger holds; what a
simulator drives is where it was seen. The figures of safety read nothing else about lanes.
"""

from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.road.lanes import LANE_CHANGE_LASTS_S

NO_MAINLINE = -1
"""The number of the ramp with its acceleration lane."""


class LaneHistory(NamedTuple):
    """Stays, one entry each: a vehicle in one lane from when it comes until it leaves.

    ``lane`` is that of the mainline, 0 next to the ramp, or -1 on the ramp with its acceleration
    lane. ``from_s`` is nan for a stay that never began. ``merged`` tells that it began with a
    change of lanes from the ramp onto the mainline. A vehicle may come to a lane more than once.
    """

    vehicle: IntArray
    lane: IntArray
    from_s: FloatArray
    until_s: FloatArray
    merged: BoolArray

    @property
    def lanes(self) -> list[int]:
        """All lanes of the history, those of the mainline first, from the one next to the ramp."""
        found = sorted({0, *self.lane.tolist()} - {NO_MAINLINE})
        return [*found, NO_MAINLINE]

    def on(self, mainline: bool) -> "LaneHistory":
        """Returns the stays on the mainline alone, or all others."""
        return self._chosen((self.lane > NO_MAINLINE) == mainline)

    def in_lane(self, lane: int) -> "LaneHistory":
        """Returns the stays in one lane alone."""
        return self._chosen(self.lane == lane)

    def _chosen(self, chosen: BoolArray) -> "LaneHistory":
        return LaneHistory._make(column[chosen] for column in self)


def planned_history(
    on_ramp: BoolArray, entry_s: FloatArray, merge_s: FloatArray, until_s: FloatArray
) -> LaneHistory:
    """Returns the history of vehicles that change lanes at ``merge_s`` at most, nan for never.

    Arrays have one entry a vehicle; ``until_s`` is when it leaves, or the run ends without it.
    """
    vehicles = np.arange(len(on_ramp))
    until_s = np.where(np.isnan(entry_s), np.nan, until_s)
    return LaneHistory(
        np.concatenate([vehicles, vehicles]),
        np.repeat([0, NO_MAINLINE], len(vehicles)),
        np.concatenate([np.where(on_ramp, merge_s, entry_s), np.where(on_ramp, entry_s, np.nan)]),
        np.concatenate([until_s, np.where(np.isnan(merge_s), until_s, merge_s)]),
        np.concatenate([on_ramp, np.zeros(len(vehicles), np.bool_)]),
    )


def with_lanes_further_in(
    history: LaneHistory, lane: IntArray, change_s: FloatArray
) -> LaneHistory:
    """Returns a planned history of a mainline of several lanes.

    Arrays have one entry a vehicle: the lane by which it came, and when it begins to change to the
    next one (s; infinity for never). It is on both while it changes.
    """
    if not lane.any() and np.isinf(change_s).all():
        return history
    begins_s, on_mainline = change_s[history.vehicle], history.lane > NO_MAINLINE
    ends_s = np.fmin(history.until_s, begins_s + LANE_CHANGE_LASTS_S)
    own = np.where(on_mainline, lane[history.vehicle], NO_MAINLINE)
    changed = on_mainline & (begins_s < history.until_s)
    stays = history._replace(lane=own, until_s=np.where(on_mainline, ends_s, history.until_s))
    more = LaneHistory(
        history.vehicle[changed],
        own[changed] + 1,
        begins_s[changed],
        history.until_s[changed],
        np.zeros(int(changed.sum()), np.bool_),
    )
    return LaneHistory._make(np.concatenate(pair) for pair in zip(stays, more, strict=True))


def seen_history(
    vehicle: IntArray, lane: IntArray, time_s: FloatArray, until_s: FloatArray
) -> LaneHistory:
    """Returns the history of vehicles from where they were seen, by vehicle and time.

    ``until_s`` has one entry a vehicle: when it leaves the lane in which it was seen last. When the
    mainline stands some drivers overtake on the acceleration lane, and so change lanes again.
    """
    same = vehicle[1:] == vehicle[:-1]
    begins = np.append(True, ~same | (lane[1:] != lane[:-1]))[: len(vehicle)]
    starts = np.flatnonzero(begins)
    whose = vehicle[starts]
    again = np.append(False, whose[1:] == whose[:-1])[: len(starts)]
    goes_on = np.append(again[1:], False)[: len(starts)]
    next_s = np.append(time_s[starts[1:]], np.nan)[: len(starts)]
    to_s = np.where(goes_on, next_s, until_s[whose])
    begun = lane[starts]
    merged = again & (begun > NO_MAINLINE)
    merged &= np.append(False, begun[:-1] == NO_MAINLINE)[: len(starts)]
    return LaneHistory(whose, begun, time_s[starts], to_s, merged)


def first_on_mainline_s(history: LaneHistory, vehicles: int) -> FloatArray:
    """Returns when each vehicle first came onto the mainline, nan for never."""
    found_s, stays = np.full(vehicles, np.nan), history.on(mainline=True)
    found_s[stays.vehicle[::-1]] = stays.from_s[::-1]
    return found_s
