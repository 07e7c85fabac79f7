"""Hands proposed commitments to the independent checker."""

from collections.abc import Sequence

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.audit.checker import Change, Verdict, examine
from coramp.audit.distances import Bounds
from coramp.coordination.book import Book
from coramp.coordination.gate import vehicles_of
from coramp.coordination.ledger import Ledger
from coramp.core.fleet import MAX_CHANGED
from coramp.core.rules import Rules
from coramp.core.trajectory import MAX_PIECES, station_and_speed
from coramp.strategies.base import FollowTrajectory


def bounds_of(rules: Rules) -> Bounds:
    """Returns the rules in the words of the checker."""
    road, safety, motion = rules.road, rules.safety, rules.motion
    return Bounds(
        zone_end_m=road.mainline_end_m,
        stop_station_m=road.stop_station_m,
        last_merge_station_m=road.last_merge_station_m,
        mainline_speed_mps=road.mainline_speed_mps,
        ramp_limit_mps=road.ramp_limit_mps,
        cos_merge_angle=float(np.cos(road.merge_angle_rad)),
        positioning_error_m=safety.positioning_error_m,
        clock_error_s=safety.clock_error_s,
        friction=safety.adhesion + safety.resistance,
        time_gap_s=safety.time_gap_s,
        standstill_gap_m=safety.standstill_gap_m,
        allowance_m=safety.execution_allowance_m,
        comfort_mps2=motion.comfort_mps2,
        ramp_acceleration_mps2=motion.ramp_acceleration_mps2,
        gap_speed_factor=1.0 + motion.speed_deviation,
    )


class Examiner:
    """Holds the buffers in which changes are laid before the checker."""

    def __init__(self, bounds: Bounds) -> None:
        self.bounds = bounds
        self._make_room(MAX_CHANGED)

    def _make_room(self, changes: int) -> None:
        self._rows = np.zeros(changes, np.int64)
        self._count = np.zeros(changes, np.int64)
        self._pieces = np.zeros((changes, MAX_PIECES, 4))
        self._merge_s = np.zeros(changes)
        self._start = np.zeros((changes, 3))
        self._makes_gap = np.zeros(changes, np.int64)

    def change(
        self, ledger: Ledger, commands: Sequence[FollowTrajectory], earliest_s: float
    ) -> Verdict:
        """Returns the verdict on trajectories that take over from what is committed."""
        if len(commands) > len(self._rows):
            self._make_room(2 * len(commands))
        for k, command in enumerate(commands):
            start_s = command.pieces[0, 0]
            station_m, speed_mps = station_and_speed(ledger.trajectory(command.row), start_s)
            self._lay(k, command, np.array([start_s, station_m, speed_mps]))
        return self._examine(ledger.book, len(commands), earliest_s)

    def _lay(self, k: int, command: FollowTrajectory, start: FloatArray) -> None:
        count = len(command.pieces)
        self._rows[k] = command.row
        self._count[k] = count
        self._pieces[k, :count] = command.pieces
        self._merge_s[k] = command.merge_time_s
        self._start[k] = start
        self._makes_gap[k] = command.makes_gap

    def _examine(self, book: Book, k: int, earliest_s: float) -> Verdict:
        change = Change(
            self._rows[:k],
            self._count[:k],
            self._pieces[:k],
            self._merge_s[:k],
            self._start[:k],
            self._makes_gap[:k],
        )
        return examine_change(book, change, earliest_s, self.bounds)


@kernel
def examine_change(book: Book, change: Change, earliest_s: float, bounds: Bounds) -> Verdict:
    """Returns the checker's verdict on a change of what stands in the book."""
    return examine(vehicles_of(book), change, earliest_s, bounds)
