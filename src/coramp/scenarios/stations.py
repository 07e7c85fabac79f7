"""Stations of the ramp that follow from its speeds where a scenario does not give them."""

import math
from typing import TYPE_CHECKING

from coramp.scenarios.checks import decision_station_range_m

if TYPE_CHECKING:
    from coramp.scenarios.model import Scenario

DECISION_SHARE = 0.25
"""How far along the stations at which a decision is possible: there delays are least.

With a time gap of 1.0 s, on each built-in road, mainline priority loses more both nearer to the
ramp's start and nearer to the nose; without one the station makes no difference.
"""


def chosen_decision_station_m(scenario: "Scenario") -> float:
    """Returns where (m) ramp vehicles are planned: early, but once all that matter have entered.

    Where no station is possible it is the last at which a vehicle can still stop.
    """
    if scenario.last_merge_station_m <= 0.0:
        return scenario.ramp.start_m  # no merge fits: the checks refuse the lane
    first_m, last_m = decision_station_range_m(scenario)
    if first_m >= last_m:
        return last_m
    station_m = first_m + DECISION_SHARE * (last_m - first_m)
    return max(first_m, float(math.floor(station_m)))
