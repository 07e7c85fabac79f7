"""What vehicles of mixed traffic lose: time against free movement, and hard braking of drivers."""

from collections.abc import Sequence

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.coordination.plant import Arrival
from coramp.metrics.types import free_time_to_s
from coramp.mixed.users import RoadUsers
from coramp.road.rules import packed
from coramp.scenarios.model import Scenario

HARD_MPS2 = 3.0
"""Braking (m/s2) beyond which a driver brakes hard."""


class Losses:
    """What each arrival has lost so far, looked at once each decision.

    ``lost_s`` is the time since the scheduled entry less that of free movement to where the
    vehicle is; who waits outside has lost all of it, and who has left loses nothing more.
    ``hard_brakings`` is how often each driver has braked harder than 3 m/s2 from one look to the
    next; however long that lasts it counts once.
    """

    def __init__(
        self, scenario: Scenario, arrivals: Sequence[Arrival], automated: BoolArray
    ) -> None:
        """Nobody has entered."""
        usual, count = scenario.usual_traits(0.0), len(arrivals)
        self._packed = packed(scenario.rules())
        self._traits = np.array([a.traits or usual for a in arrivals], np.float64).reshape(
            count, len(usual)
        )
        self._on_ramp = np.array([a.on_ramp for a in arrivals], np.bool_)
        self._scheduled_s = np.array([a.step * scenario.control.step_s for a in arrivals])
        self._end_m, self._automated = scenario.mainline.end_m, automated
        self._station_m, self._speed_mps = np.full(count, np.nan), np.full(count, np.nan)
        self._hard, self._left = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        self._seen_s = 0.0
        self.lost_s, self.hard_brakings = np.zeros(count), np.zeros(count, np.int64)

    def look(self, now_s: float, users: RoadUsers) -> None:
        """Takes in where everybody on the road is now."""
        period_s, number = now_s - self._seen_s, users.number
        here = np.zeros(len(self.lost_s), np.bool_)
        here[number] = True
        entered = ~np.isnan(self._station_m)
        self._leave(np.flatnonzero(entered & ~here & ~self._left), period_s)
        due = ~entered & ~here & (self._scheduled_s <= now_s)
        self.lost_s[due] = now_s - self._scheduled_s[due]
        braking_mps2 = (self._speed_mps[number] - users.speed_mps) / period_s  # nan: just entered
        hard = (braking_mps2 > HARD_MPS2) & ~self._automated[number]
        self.hard_brakings[number] += hard & ~self._hard[number]
        self._hard[number] = hard
        self._station_m[number], self._speed_mps[number] = users.station_m, users.speed_mps
        self.lost_s[number] = now_s - self._scheduled_s[number] - self._free_s(number)
        self._seen_s = now_s

    def _leave(self, number: IntArray, period_s: float) -> None:
        """Who was on the road at the last look and is no more has run on at its speed."""
        left_m = self._end_m - self._station_m[number]
        run_on_s = np.minimum(left_m / np.maximum(self._speed_mps[number], 1e-9), period_s)
        self._station_m[number] = self._end_m
        since_s = self._seen_s + run_on_s - self._scheduled_s[number]
        self.lost_s[number] = since_s - self._free_s(number)
        self._left[number] = True

    def _free_s(self, number: IntArray) -> FloatArray:
        return free_times_s(
            self._station_m[number], self._traits[number], self._on_ramp[number], self._packed
        )


@kernel
def free_times_s(
    station_m: FloatArray, traits: FloatArray, on_ramp: BoolArray, packed_rules: FloatArray
) -> FloatArray:
    """Returns the time (s) of each vehicle from its stream's start to its station if alone."""
    free_s = np.empty(len(station_m))
    for k in range(len(station_m)):
        free_s[k] = free_time_to_s(station_m[k], traits[k], on_ramp[k], packed_rules)
    return free_s
