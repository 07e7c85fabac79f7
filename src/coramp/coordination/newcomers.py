"""Whether a merge stands in the way of a mainline vehicle that is yet to enter."""

from collections.abc import Sequence

from coramp.coordination.ledger import Ledger
from coramp.equations.safe_distance import merge_clearance_m
from coramp.kinematics.trajectory import station_and_speed
from coramp.road.rules import Rules
from coramp.strategies.base import FollowTrajectory
from coramp.strategies.situation import foremost_unknown_m
from coramp.vehicles.merge_state import has_place_on_mainline, is_waiting

ROUNDING_M = 1e-6


class Newcomers:
    """The places that mainline vehicles can have which have not entered yet."""

    def __init__(self, fastest_entry_mps: float, rules: Rules) -> None:
        self._v0_mps = rules.road.mainline_speed_mps
        self._foremost_at_0_m = foremost_unknown_m(0.0, fastest_entry_mps, rules)
        self._clearance_m = merge_clearance_m(rules.road, rules.safety)

    def are_held_up(
        self, ledger: Ledger, commands: Sequence[FollowTrajectory], time_s: float
    ) -> bool:
        """Returns whether a new merge may hold up a vehicle that has not entered by ``time_s``.

        The merge must leave a length and the clearance to the foremost place that such a vehicle
        can have, on the way that it would drive with nobody before it.
        """
        for command in commands:
            merge_s = command.merge_time_s
            known = has_place_on_mainline(ledger.merge_time_s(command.row))
            if known or is_waiting(merge_s):
                continue
            last_s, last_m = command.pieces[-1, :2].tolist()
            station_m = last_m  # plans merge where their last piece begins
            if last_s != merge_s:
                station_m, _ = station_and_speed(command.pieces, merge_s)
            rear_m = station_m - self._v0_mps * merge_s - ledger.length_m(command.row)
            foremost_m = self._foremost_at_0_m - self._v0_mps * time_s
            if rear_m - self._clearance_m < foremost_m - ROUNDING_M:
                return True
        return False
