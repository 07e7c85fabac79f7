"""When vehicles pass a station within an interval, and when they must enter for that."""

from typing import NamedTuple, Self

import numpy as np

from coramp._kernel import FloatArray, IntArray

MARGIN_S, MARGIN_OF_WAY, MARGIN_SHARE = 2.0, 0.15, 0.08
"""Nobody passes a detector so near to an interval's ends where there is room, in s or as a share of
the time from the entry, but at most this share of the interval: drivers take longer or shorter than
undisturbed."""
FOLLOW_S, STANDSTILL_M = 1.2, 2.5
"""Time gap and gap at rest that SUMO's drivers ask for behind each other, and a bit more."""
BRAKING_MPS2 = 4.5
"""How hard SUMO's drivers brake in comfort."""
WISHES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""How much of the headway above the least one vehicles get: the most that there is room for."""
BLOCKS = (1, 4, 16, 10**9)
"""In blocks of so many the slower ones come first, the smallest for which there is room: behind a
faster one, a slower one needs more room at the entry the farther the station is."""
FULL = 0.95
"""So much of an interval headways may fill before they are made shorter."""


class Stream(NamedTuple):
    """Vehicles in their order, an entry each; ``number`` says who each of them is.

    ``way_s`` is how long it takes from its entry until its rear has passed the station.
    """

    number: IntArray
    length_m: FloatArray
    entry_mps: FloatArray
    way_s: FloatArray

    def in_order(self, order: IntArray) -> Self:
        """Returns the same vehicles in another order."""
        return self._replace(**{name: values[order] for name, values in self._asdict().items()})

    def in_blocks(self, size: int) -> Self:
        """Returns them with the slower ones first in each block of so many."""
        blocks = np.arange(len(self.number)) // size
        return self.in_order(np.lexsort((-self.way_s, blocks)))


def headways_s(before: Stream, stream: Stream, least_s: float, wish: float) -> FloatArray:
    """Returns the least headway (s) of each at the station, behind the one before it.

    ``before`` is the last vehicle of the interval before, or empty: then the first needs none.
    ``wish`` goes from 0, where only ``least_s`` is kept, at the entry and at the station, to 1,
    where SUMO's drivers have the gap that they ask for.
    """
    length_m = np.concatenate([before.length_m, stream.length_m])
    mps = np.concatenate([before.entry_mps, stream.entry_mps])
    way_s = np.concatenate([before.way_s, stream.way_s])
    ahead, own = mps[:-1], mps[1:]
    brake_s = np.maximum(0.0, own**2 - ahead**2) / (2.0 * BRAKING_MPS2 * own)
    entry_s = FOLLOW_S + (length_m[:-1] + STANDSTILL_M) / own + brake_s
    entry_s = least_s + wish * np.maximum(0.0, entry_s - least_s)
    station_s = FOLLOW_S + (length_m[1:] + STANDSTILL_M) / np.minimum(ahead, own)
    station_s = least_s + wish * np.maximum(0.0, station_s - least_s)
    headways = np.maximum(station_s, entry_s + np.diff(way_s))
    return headways if len(before.number) else np.concatenate([[0.0], headways])


class Clock:
    """Places vehicles interval by interval, on a grid of steps, behind each other."""

    def __init__(self, step_s: float, least_s: float) -> None:
        self._step_s = step_s
        self._least_s = least_s
        nothing = np.empty(0)
        self._last = Stream(np.empty(0, np.int64), nothing, nothing, nothing)
        self._last_s = 0.0
        self._last_step = -1

    def placed(
        self, begin_s: float, end_s: float, stream: Stream, random: np.random.Generator
    ) -> tuple[IntArray, Stream]:
        """Returns the steps at which vehicles enter, and the vehicles in that order.

        All of them pass within the interval. Where they do not take up all of it, the time that is
        left lies at random between them: given how many come, and their least headways, every
        placing is equally likely.
        """
        stream, headways, first_s, room_s = self._fitting(begin_s, end_s, stream)
        offsets = np.cumsum(headways[1:], dtype=np.float64)
        need_s = float(offsets[-1]) if len(offsets) else 0.0
        if need_s > room_s:
            offsets *= max(room_s, 0.0) / need_s
            need_s = room_s
        free_s = np.sort(random.random(len(headways))) * max(0.0, room_s - need_s)
        passing_s = first_s + free_s + np.concatenate([[0.0], offsets])
        return self._steps(begin_s, passing_s, stream), stream

    def _fitting(
        self, begin_s: float, end_s: float, stream: Stream
    ) -> tuple[Stream, FloatArray, float, float]:
        """The order and headways that fit, when the first may pass, and how long there is room."""
        shifted = bool(stream.way_s.any())
        margin_s = 0.0
        if shifted:
            unsure_s = max(MARGIN_S, MARGIN_OF_WAY * float(stream.way_s.max()))
            margin_s = min(unsure_s, MARGIN_SHARE * (end_s - begin_s))
        ends_s = end_s - max(margin_s, self._step_s)
        tightest = None
        for wish in WISHES:
            for size in BLOCKS:
                ordered = stream if size == 1 else stream.in_blocks(size)
                headways = headways_s(self._last, ordered, self._least_s, wish)
                first_s = self._first_s(begin_s + margin_s, headways[0], ordered)
                room_s = ends_s - first_s
                tightest = ordered, headways, first_s, room_s
                if float(headways[1:].sum()) <= FULL * room_s:
                    return tightest
                if not shifted:
                    break  # the order makes no difference
        assert tightest is not None
        ordered, headways, _, _ = tightest
        first_s = self._first_s(begin_s, headways[0], ordered)
        return ordered, headways, first_s, end_s - self._step_s - first_s

    def _first_s(self, begin_s: float, headway_s: float, stream: Stream) -> float:
        """When the first may pass: behind the last one, and so that it enters at 0 or later."""
        behind_s = self._last_s + headway_s if len(self._last.number) else begin_s
        return max(begin_s, behind_s, float(stream.way_s[0]))

    def _steps(self, begin_s: float, passing_s: FloatArray, stream: Stream) -> IntArray:
        entry_s = passing_s - stream.way_s
        steps = np.floor(entry_s / self._step_s + 1e-9).astype(np.int64)
        if not stream.way_s.any():
            steps = np.maximum(steps, int(np.ceil(begin_s / self._step_s - 1e-9)))
        order = np.arange(len(steps))
        # one after another: at least a step lies between two
        steps = np.maximum.accumulate(np.maximum(steps, self._last_step + 1) - order) + order
        self._last = stream.in_order(np.array([len(steps) - 1]))
        self._last_s, self._last_step = float(passing_s[-1]), int(steps[-1])
        return steps
