"""Whether a merge stands in the way of a mainline vehicle that is yet to enter."""

import math
from collections.abc import Sequence

from coramp.coordination.ledger import Ledger
from coramp.core.rules import Rules
from coramp.core.safe_distance import merge_clearance_m
from coramp.core.trajectory import station_and_speed
from coramp.strategies.base import FollowTrajectory
from coramp.strategies.situation import foremost_unknown_m

ROUNDING_M = 1e-6


def in_the_way(
    ledger: Ledger,
    commands: Sequence[FollowTrajectory],
    time_s: float,
    fastest_entry_mps: float,
    rules: Rules,
) -> bool:
    """Returns whether a new merge may bother a vehicle that has not entered by ``time_s``.

    The merge must leave a length and the clearance to the foremost place that such a vehicle can
    have, on the way that it would drive with nobody before it.
    """
    v0 = rules.road.mainline_speed_mps
    foremost_m = foremost_unknown_m(time_s, fastest_entry_mps, rules)
    clearance_m = merge_clearance_m(rules.road, rules.safety)
    for command in commands:
        if command.merge_time_s == math.inf or ledger.merge_time_s(command.row) < math.inf:
            continue
        station_m, _ = station_and_speed(command.pieces, command.merge_time_s)
        rear_m = station_m - v0 * command.merge_time_s - ledger.length_m(command.row)
        if rear_m - clearance_m < foremost_m - ROUNDING_M:
            return True
    return False
