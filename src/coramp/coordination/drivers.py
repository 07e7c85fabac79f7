"""Drivers: vehicles that report where they are, can be shown a signal, and take no commands."""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from coramp.messages.commands import SetSignal
from coramp.messages.events import Report
from coramp.strategies.base import (
    Command,
    Drivers,
    DriveWithAcceleration,
    ReleaseToDriver,
    Reports,
    SetRampSignal,
)

FIRST_ROW = -2
"""Row of the first driver that was heard of; the next ones have -3, -4 and so on."""
NOBODY = -1


class DriverRoad:
    """What is heard of the drivers on a road, and what they are shown.

    ``ask`` has all of them report at once, where the world can do that. Without it those count who
    reported last, at one time.
    """

    def __init__(
        self, metered: bool = False, ask: Callable[[], Iterable[Report]] | None = None
    ) -> None:
        self._metered = metered
        self._ask = ask
        self._rows: dict[str, int] = {}
        self._heard: list[Report] = []
        self._shown: list[SetSignal] = []

    def hear(self, report: Report) -> None:
        """Notes a report; one that is older than others that were heard changes nothing."""
        if self._heard and report.time_s > self._heard[0].time_s:
            self._heard = []
        if not self._heard or report.time_s == self._heard[0].time_s:
            self._heard.append(report)

    def seen(self) -> Drivers:
        """Returns who drives on the road, as last reported."""
        told = self._heard if self._ask is None else list(self._ask())
        rows = [self._rows.setdefault(r.vehicle_id, FIRST_ROW - len(self._rows)) for r in told]
        numbers = np.array([(r.time_s, r.station_m, r.speed_mps, r.std_m) for r in told])
        return Drivers(np.array(rows, np.int64), Reports(*numbers.reshape(-1, 4).T.copy()))

    def show(self, signal: SetRampSignal, step: int) -> bool:
        """Sets the signal at the ramp; returns False on a road that has none."""
        if self._metered:
            self._shown.append(SetSignal(step, signal.green))
        return self._metered

    def taken(self) -> tuple[SetSignal, ...]:
        """Returns what has been shown since this was last asked."""
        shown, self._shown = tuple(self._shown), []
        return shown


class Sorted(NamedTuple):
    """The commands of a decision that are no trajectories, by whom they are for.

    ``refused`` counts those that nobody can carry out.
    """

    drives: list[DriveWithAcceleration]
    signals: list[SetRampSignal]
    refused: int


def sorted_by_taker(commands: Sequence[Command]) -> Sorted:
    """Returns which commands, trajectories aside, vehicles and signal can carry out.

    Accelerations for drivers are refused one by one. Releasing a driver changes nothing; an
    automated vehicle has no driver to be left to. Trajectories the checker refuses all together.
    """
    drives = [c for c in commands if isinstance(c, DriveWithAcceleration)]
    signals = [c for c in commands if isinstance(c, SetRampSignal)]
    released = [c for c in commands if isinstance(c, ReleaseToDriver)]
    taken = [c for c in drives if c.row > NOBODY]
    refused = len(drives) - len(taken) + sum(c.row > NOBODY for c in released)
    return Sorted(taken, signals, refused)
