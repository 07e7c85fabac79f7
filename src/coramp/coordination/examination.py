"""Hands proposed commitments to the independent checker."""

import math
from collections.abc import Sequence

import numpy as np

from coramp._kernel import kernel
from coramp.checker.checker import Change, Verdict, examine
from coramp.checker.distances import Bounds
from coramp.checker.record import Record, empty_record, with_room
from coramp.kinematics.trajectory import MAX_PIECES
from coramp.road.lanes import LANE_CHANGE_LASTS_S
from coramp.road.rules import Rules
from coramp.strategies.base import FollowTrajectory
from coramp.vehicles.fleet import MAX_CHANGED


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
        friction=safety.adhesion + safety.resistance,
        standstill_gap_m=safety.standstill_gap_m,
        allowance_m=safety.execution_allowance_m,
        comfort_mps2=motion.comfort_mps2,
        ramp_acceleration_mps2=motion.ramp_acceleration_mps2,
        gap_speed_factor=1.0 + motion.speed_deviation,
        lanes=road.lanes,
        lane_change_lasts_s=LANE_CHANGE_LASTS_S,
    )


class Examiner:
    """Lays changes before the checker.

    ``record`` is the checker's own of what was commanded; ``commitments`` writes into it. It is
    replaced as it grows.
    """

    def __init__(self, bounds: Bounds, vehicles: int = 0) -> None:
        self.bounds = bounds
        self.record: Record = empty_record(max(16, vehicles), 8 * max(16, vehicles))
        self._room_for(MAX_CHANGED)

    def make_room(self, commands: int = 1) -> None:
        """Makes sure that the record has room for one more row and so many commands."""
        self.record = with_room(self.record, commands, MAX_PIECES)

    def _room_for(self, changes: int) -> None:
        self._change = Change(
            np.zeros(changes, np.int64),
            np.zeros(changes, np.int64),
            np.zeros((changes, MAX_PIECES, 4)),
            np.zeros(changes),
            np.zeros(changes, np.int64),
            np.full(changes, math.inf),
        )

    def change(
        self, commands: Sequence[FollowTrajectory], now_s: float, earliest_s: float
    ) -> Verdict:
        """Returns the verdict on trajectories that take over from what is committed."""
        if len(commands) > len(self._change.rows):
            self._room_for(2 * len(commands))
        change = self._change
        for k, command in enumerate(commands):
            count = len(command.pieces)
            change.rows[k] = command.row
            change.piece_count[k] = count
            change.pieces[k, :count] = command.pieces
            change.merge_s[k] = command.merge_time_s
            change.makes_gap[k] = command.makes_gap
            change.lane_change_s[k] = command.lane_change_s
        return examine_first(self.record, change, len(commands), now_s, earliest_s, self.bounds)


@kernel
def examine_first(
    record: Record, change: Change, count: int, now_s: float, earliest_s: float, bounds: Bounds
) -> Verdict:
    """Returns the checker's verdict on the first ``count`` entries of a change."""
    in_use = Change(
        change.rows[:count],
        change.piece_count[:count],
        change.pieces[:count],
        change.merge_s[:count],
        change.makes_gap[:count],
        change.lane_change_s[:count],
    )
    return examine(record, in_use, now_s, earliest_s, bounds)
