"""Hands proposed commitments to the independent checker."""

from collections.abc import Sequence

import numpy as np

from coramp._kernel import kernel
from coramp.checker.checker import Change, Verdict, examine
from coramp.checker.distances import Bounds
from coramp.coordination.book import Book, fleet_of
from coramp.coordination.gate import vehicles_of
from coramp.coordination.ledger import Ledger
from coramp.kinematics.trajectory import MAX_PIECES, TIME, station_and_speed
from coramp.road.rules import Rules
from coramp.strategies.base import FollowTrajectory
from coramp.vehicles.fleet import MAX_CHANGED, committed


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
        self._change = Change(
            np.zeros(changes, np.int64),
            np.zeros(changes, np.int64),
            np.zeros((changes, MAX_PIECES, 4)),
            np.zeros(changes),
            np.zeros((changes, 3)),
            np.zeros(changes, np.int64),
        )

    def change(
        self, ledger: Ledger, commands: Sequence[FollowTrajectory], earliest_s: float
    ) -> Verdict:
        """Returns the verdict on trajectories that take over from what is committed."""
        if len(commands) > len(self._change.rows):
            self._make_room(2 * len(commands))
        change = self._change
        for k, command in enumerate(commands):
            count = len(command.pieces)
            change.rows[k] = command.row
            change.piece_count[k] = count
            change.pieces[k, :count] = command.pieces
            change.merge_s[k] = command.merge_time_s
            change.makes_gap[k] = command.makes_gap
        return examine_change(ledger.book, change, len(commands), earliest_s, self.bounds)


@kernel
def examine_change(
    book: Book, change: Change, count: int, earliest_s: float, bounds: Bounds
) -> Verdict:
    """Returns the checker's verdict on the first ``count`` entries of a change of the book.

    Fills in where each must take over: what is committed for its first time.
    """
    fleet = fleet_of(book)
    for k in range(count):
        start_s = change.pieces[k, 0, TIME]
        station_m, speed_mps = station_and_speed(committed(fleet, change.rows[k]), start_s)
        change.start[k, 0], change.start[k, 1], change.start[k, 2] = start_s, station_m, speed_mps
    in_use = Change(
        change.rows[:count],
        change.piece_count[:count],
        change.pieces[:count],
        change.merge_s[:count],
        change.start[:count],
        change.makes_gap[:count],
    )
    return examine(vehicles_of(book), in_use, earliest_s, bounds)
