"""A session that notes where every vehicle is at each of its steps, as SUMO tells it."""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.worlds.sumo.files import Samples
from coramp.worlds.sumo.network import LaneSpan
from coramp.worlds.sumo.session import Session

MS_A_S = 1000


class Look(NamedTuple):
    """Who is on the road after a step, one entry each, in the order of their names.

    ``place`` is that of each one's lane among all lanes.
    """

    names: list[str]
    number: IntArray
    place: IntArray
    position_m: FloatArray
    speed_mps: FloatArray


@dataclass
class Watch:
    """Lets a session go on step by step, and notes positions in memory, not in a file of SUMO's.

    ``spans`` are the lanes on which anybody can be; those that the network lacks are left out.
    ``numbers`` are those of vehicles by their names. What is noted of a vehicle at a step takes
    20 bytes.
    """

    session: Session
    spans: Mapping[str, LaneSpan]
    numbers: Mapping[str, int]
    step_s: float
    _lanes: tuple[str, ...] = field(init=False)
    _names: list[str] = field(init=False)
    _rank: IntArray = field(init=False)
    _steps: int = 0
    _on_lane: "array[int]" = field(default_factory=lambda: array("i"))
    _number: "array[int]" = field(default_factory=lambda: array("i"))
    _position_m: "array[float]" = field(default_factory=lambda: array("d"))
    _speed_mps: "array[float]" = field(default_factory=lambda: array("d"))

    def __post_init__(self) -> None:
        """Nobody has been seen yet."""
        there = self.session.lanes()
        self.spans = {lane: span for lane, span in self.spans.items() if lane in there}
        self._lanes, self._names = tuple(self.spans), list(self.numbers)
        self._rank = np.empty(len(self._names), np.int64)
        by_name = sorted(range(len(self._names)), key=self._names.__getitem__)
        self._rank[by_name] = np.arange(len(self._names))

    def step_to(self, step: int) -> None:
        """Executes all steps before ``step``; raises CorampError where SUMO gives up."""
        for done in range(self._steps + 1, step + 1):
            self.session.step_to(done)
            self._note()

    def step_on(self) -> None:
        """Executes one step."""
        self.session.step_on()
        self._note()

    def _note(self) -> None:
        names, on_lane, position_m, speed_mps = self.session.on_lanes(self._lanes)
        self._steps += 1
        self._on_lane.extend(on_lane)
        self._number.extend(map(self.numbers.__getitem__, names))
        self._position_m.extend(position_m)
        self._speed_mps.extend(speed_mps)

    def look(self) -> Look:
        """Returns who is on the road now."""
        number, place, position_m, speed_mps = self._since(self._steps - 1)
        order = np.argsort(self._rank[number])
        number = number[order]
        names = [self._names[n] for n in number.tolist()]
        return Look(names, number, place[order], position_m[order], speed_mps[order])

    def _since(self, step: int) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """What was noted from a step on: numbers, places of lanes, positions (m), speeds (m/s)."""
        on_lane = np.array(self._on_lane[step * len(self._lanes) :], np.int64)
        place = np.tile(np.arange(len(self._lanes)), self._steps - step)
        first = len(self._number) - int(on_lane.sum())
        return (
            np.array(self._number[first:], np.int64),
            np.repeat(place, on_lane),
            np.array(self._position_m[first:], np.float64),
            np.array(self._speed_mps[first:], np.float64),
        )

    def finished(self) -> BoolArray:
        """Returns which vehicles have left the road, one entry each of all."""
        here, seen = self._since(self._steps - 1)[0], np.zeros(len(self._names), np.bool_)
        seen[np.frombuffer(self._number, np.int32)] = True
        seen[here] = False
        return seen

    def samples(self) -> Samples:
        """Returns all positions, by vehicle and time."""
        number, place, position_m, speed_mps = self._since(0)
        lanes, spans = len(self._lanes), list(self.spans.values())
        at_step = np.frombuffer(self._on_lane, np.int32).reshape(self._steps, lanes).sum(axis=1)
        step_ms = round(MS_A_S * self.step_s)
        time_s = np.repeat(np.arange(self._steps) * step_ms / MS_A_S, at_step)
        order = np.argsort(number, kind="stable")
        start_m = np.array([span.start_m for span in spans])
        per_m = np.array([span.per_m for span in spans])
        lane = np.array([span.lane for span in spans], np.int64)
        station_m = start_m[place] + position_m * per_m[place]
        return Samples(
            number[order], lane[place][order], time_s[order], station_m[order], speed_mps[order]
        )
