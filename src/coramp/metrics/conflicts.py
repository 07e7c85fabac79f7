"""How many conflicts a run has, by how grave they are: TTC, DRAC, PET and severity (Eq. 5 to 9).

From positions at the simulator's steps. A pair of neighbours in a lane counts once for as long as
it stays one, with its smallest TTC and its largest DRAC. A lane change counts once with each of its
neighbours: PET is the time between one vehicle's rear leaving a place and the other's front
reaching it, at the station where the lane change ends (the vehicle ahead) and one length before it
(the vehicle behind); severity is that of the masses, speeds and distance there.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray
from coramp.checker.among_drivers import Pairs, Seen, pairs_of
from coramp.equations.conflict_risk import SEVERITY_THRESHOLD_M2PS4, severity_of_masses_m2ps4
from coramp.records.schemas import Row

TTC_S = {"conflicts_ttc_3": 3.0, "conflicts_ttc_1_5": 1.5, "conflicts_ttc_1": 1.0}
"""Pairs that come below a TTC; 1.5 s is usual for a conflict on motorways."""
DRAC_MPS2 = {"conflicts_drac_2": 2.0, "conflicts_drac_3_4": 3.4, "conflicts_drac_6": 6.0}
"""Pairs that come above a DRAC; 3.4 m/s2 is what most drivers can brake (AASHTO)."""
PET_S = {"conflicts_pet_1": 1.0, "conflicts_pet_0_5": 0.5, "conflicts_pet_0_2": 0.2}
"""Neighbours at a lane change that come below a PET."""
SEVERITY = {
    "conflicts_j_1": SEVERITY_THRESHOLD_M2PS4,
    "conflicts_j_10": 10.0 * SEVERITY_THRESHOLD_M2PS4,
    "conflicts_j_100": 100.0 * SEVERITY_THRESHOLD_M2PS4,
}
"""Neighbours at a lane change that come above J: multiples of (0.3 g)^2."""


class Conflicts(NamedTuple):
    """One entry a pair that closes in: TTC (s), DRAC (m/s2); one a neighbour at a lane change.

    PET (s) is infinite for who never reaches the place; J (m2/s4) is Eq. 5 in its relative form,
    that of the lighter vehicle.
    """

    ttc_s: FloatArray
    drac_mps2: FloatArray
    pet_s: FloatArray
    severity_m2ps4: FloatArray

    def counts(self) -> Row:
        """Returns how many are graver than each limit."""
        return {
            **{name: int((self.ttc_s < limit).sum()) for name, limit in TTC_S.items()},
            **{name: int((self.drac_mps2 > limit).sum()) for name, limit in DRAC_MPS2.items()},
            **{name: int((self.pet_s < limit).sum()) for name, limit in PET_S.items()},
            **{name: int((self.severity_m2ps4 > limit).sum()) for name, limit in SEVERITY.items()},
        }


def conflicts_of(seen: Seen, first: IntArray, mass_kg: FloatArray) -> Conflicts:
    """Returns the conflicts of a run; vehicle i's rows are ``first[i]`` to ``first[i + 1]``."""
    pairs = pairs_of(seen)
    ttc_s, drac_mps2 = _closing(seen, pairs)
    pet_s, severity_m2ps4 = _at_lane_changes(seen, pairs, first, mass_kg)
    return Conflicts(ttc_s, drac_mps2, pet_s, severity_m2ps4)


def _closing(seen: Seen, pairs: Pairs) -> tuple[FloatArray, FloatArray]:
    """The smallest TTC and the largest DRAC of each pair that closes in.

    Vehicles that overlap have a TTC of 0 and an infinite DRAC.
    """
    closing_mps = seen.speed_mps[pairs.rear] - seen.speed_mps[pairs.front]
    near = (closing_mps > 0.0) & (pairs.gap_m < closing_mps * max(TTC_S.values()))
    near |= pairs.gap_m <= 0.0
    near |= (closing_mps > 0.0) & (closing_mps**2 > 2.0 * min(DRAC_MPS2.values()) * pairs.gap_m)
    gap_m, closing_mps = pairs.gap_m[near], closing_mps[near]
    touch = gap_m <= 0.0
    safe_m, safe_mps = np.where(touch, 1.0, gap_m), np.where(touch, 1.0, closing_mps)
    ttc_s = np.where(touch, 0.0, safe_m / safe_mps)
    drac_mps2 = np.where(touch, np.inf, 0.5 * safe_mps**2 / safe_m)
    count = len(seen.length_m)
    rear, front = seen.vehicle[pairs.rear[near]], seen.vehicle[pairs.front[near]]
    who = np.minimum(rear, front) * count + np.maximum(rear, front)  # a simulator lets them swap
    pair, place = np.unique(who, return_inverse=True)
    least_s, most_mps2 = np.full(len(pair), np.inf), np.zeros(len(pair))
    np.minimum.at(least_s, place, ttc_s)
    np.maximum.at(most_mps2, place, drac_mps2)
    return least_s, most_mps2


def _at_lane_changes(
    seen: Seen, pairs: Pairs, first: IntArray, mass_kg: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """PET and severity of each neighbour at each lane change onto the mainline."""
    came = np.zeros(len(seen.vehicle), np.bool_)
    came[1:] = (seen.vehicle[1:] == seen.vehicle[:-1]) & (seen.lane[:-1] < 0)
    came &= seen.lane >= 0
    ahead, behind = came[pairs.rear], came[pairs.front]
    places = np.flatnonzero(ahead | behind)
    pet_s = np.array([_pet_s(seen, pairs, first, k) for k in places.tolist()], np.float64)
    severity = [_severity_m2ps4(seen, pairs, mass_kg, k) for k in places.tolist()]
    return pet_s, np.array(severity, np.float64)


def _pet_s(seen: Seen, pairs: Pairs, first: IntArray, k: int) -> float:
    """When the rear one reaches the place, less when the front one left it."""
    rear, front = int(pairs.rear[k]), int(pairs.front[k])
    length_m = float(seen.length_m[seen.vehicle[front]])
    if _comes(seen, rear):
        place_m = float(seen.station_m[rear])
        left_s = _passes_s(seen, first, front, place_m + length_m)
        return float(seen.time_s[rear]) - left_s
    place_m = float(seen.station_m[front]) - length_m
    return _passes_s(seen, first, rear, place_m) - float(seen.time_s[front])


def _comes(seen: Seen, row: int) -> bool:
    """Whether a vehicle has changed lanes since its row before."""
    same = row > 0 and seen.vehicle[row - 1] == seen.vehicle[row]
    return bool(same and seen.lane[row] >= 0 and seen.lane[row - 1] < 0)


def _passes_s(seen: Seen, first: IntArray, row: int, station_m: float) -> float:
    """When the vehicle of a row is at a station: infinity for never, as early as it was seen."""
    vehicle = seen.vehicle[row]
    own = slice(first[vehicle], first[vehicle + 1])
    stations_m, times_s = seen.station_m[own], seen.time_s[own]
    if station_m > stations_m[-1]:
        return math.inf
    return float(np.interp(station_m, stations_m, times_s))


def _severity_m2ps4(seen: Seen, pairs: Pairs, mass_kg: FloatArray, k: int) -> float:
    rear, front = int(pairs.rear[k]), int(pairs.front[k])
    masses = mass_kg[seen.vehicle[rear]], mass_kg[seen.vehicle[front]]
    if seen.speed_mps[rear] <= seen.speed_mps[front] and pairs.gap_m[k] > 0.0:
        return 0.0  # the gap opens
    speeds = seen.speed_mps[rear], seen.speed_mps[front]
    _, relative = severity_of_masses_m2ps4(*speeds, float(pairs.gap_m[k]), *masses)
    return float(relative)
