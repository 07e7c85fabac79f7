"""Automated vehicles among drivers, judged from positions alone: who came too near, and by whom.

What an automated vehicle promises: to every leader it keeps the distance that it needs if that
leader brakes at b,

    gap + v_l^2 / (2 b)  >=  v^2 / (2 b),

and it changes lanes in front of a driver only where he, keeping s_0 + T v, need not brake harder
than in comfort. That holds as long as drivers neither come in nearer than that, nor brake harder
than b. Who does so is named here; a collision is the fault of whoever broke his side.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray

BY_AUTOMATED, BY_DRIVER, AMONG_DRIVERS = "by automated", "by driver", "among drivers"
CUT_IN, HARD_BRAKING = "cut in", "braked harder"
TOUCH_M = 0.01
"""Less than this is rounding of positions, which SUMO writes to 0.1 mm."""
EXACT_M = 0.5
"""What half a step's change of speed is worth in a stopping distance."""
EXACT_MPS2 = 0.2
REMEMBERED_S = 8.0
"""A broken assumption explains what happens to the pair up to so much later."""
STANDING_M = 0.5
"""What whoever merges leaves a driver who stands."""
MOMENT_S = 0.25
"""Who came into a lane no longer ago cannot have been reckoned with: a command takes 0.2 s."""
COMFORT_MPS2 = 4.5
"""The braking by which SUMO's drivers judge gaps."""


class Seen(NamedTuple):
    """Where vehicles were at each step, by vehicle and time; lengths and kinds by vehicle.

    ``lane`` is that of the mainline, 0 next to the ramp, or -1 on ramp and acceleration lane.
    """

    vehicle: IntArray
    time_s: FloatArray
    station_m: FloatArray
    speed_mps: FloatArray
    lane: IntArray
    length_m: FloatArray
    automated: BoolArray


class Limits(NamedTuple):
    """The leader's braking b (m/s2) that is reckoned with, and what a driver behind is left.

    That is ``driver_gap_m`` and a time gap: ``driver_gap_s``, which drivers keep on average, and
    where the acceleration lane ends, at ``lane_end_m``, ``least_driver_gap_s``, the shortest.
    ``relax_m`` is by how much a lane change may fall short, ``relax_at_end_m`` by how much more at
    the lane's end. Before that both changes grow with the square of the station.
    """

    braking_mps2: float
    driver_gap_m: float
    driver_gap_s: float
    least_driver_gap_s: float
    relax_m: float
    relax_at_end_m: float
    lane_end_m: float


@dataclass(frozen=True)
class Collision:
    """A pair that overlapped, or that the simulator saw collide, and whose fault it is."""

    time_s: float
    rear: int
    front: int
    cause: str


@dataclass(frozen=True)
class Broken:
    """A driver did what is assumed not to happen: ``front`` to the automated vehicle ``rear``."""

    time_s: float
    rear: int
    front: int
    what: str


@dataclass(frozen=True)
class Findings:
    """Collisions, assumptions that drivers broke, and promises that automated vehicles broke."""

    collisions: tuple[Collision, ...]
    broken: tuple[Broken, ...]
    unkept: tuple[tuple[float, int, int], ...]


class Pairs(NamedTuple):
    """Neighbours in a lane at each step: rows of ``Seen``, and the gap between bumpers (m)."""

    rear: IntArray
    front: IntArray
    gap_m: FloatArray


def findings_of(
    seen: Seen, limits: Limits, reported: Sequence[tuple[float, int, int]] = ()
) -> Findings:
    """Returns what positions tell; ``reported`` are a simulator's collisions: time, rear, front."""
    pairs = pairs_of(seen)
    came_in, braking_mps2 = _came_in(seen), _braking_mps2(seen)
    rear, front = seen.vehicle[pairs.rear], seen.vehicle[pairs.front]
    time_s = seen.time_s[pairs.rear]
    keeps = seen.automated[rear]
    short = keeps & (_spare_m(seen, pairs, limits) < -EXACT_M)
    cut_in = short & came_in[pairs.front] & ~seen.automated[front]
    hard = keeps & ~seen.automated[front]
    hard &= braking_mps2[pairs.front] > limits.braking_mps2 + EXACT_MPS2
    touching = _first_of_each(time_s, rear, front, pairs.gap_m < -TOUCH_M)
    touched = _first_of_two([*reported, *touching])
    broken = [
        Broken(float(time_s[k]), int(rear[k]), int(front[k]), CUT_IN if cut_in[k] else HARD_BRAKING)
        for k in np.flatnonzero(cut_in | hard)
    ]
    broken = [b for b in broken if not _over(touched, b.time_s, b.rear, b.front)]
    unkept = _first_of_each(time_s, rear, front, short)
    unkept += _first_of_each(time_s, rear, front, _pushed_in(seen, pairs, came_in, limits))
    unkept = [
        pair for pair in unkept if not (_behind_a_wreck(touched, pair) or _explained(pair, broken))
    ]
    collisions = tuple(
        Collision(*pair, _cause(pair, seen.automated, broken, unkept))
        for pair in sorted(touched.values())
    )
    return Findings(collisions, tuple(_once(broken)), tuple(unkept))


def pairs_of(seen: Seen) -> Pairs:
    """Returns all pairs of neighbours in a lane, step by step."""
    order = np.lexsort((-seen.station_m, seen.lane, seen.time_s))
    front, rear = order[:-1], order[1:]
    together = seen.time_s[front] == seen.time_s[rear]
    together &= seen.lane[front] == seen.lane[rear]
    front, rear = front[together], rear[together]
    tail_m = seen.station_m[front] - seen.length_m[seen.vehicle[front]]
    return Pairs(rear, front, tail_m - seen.station_m[rear])


def _came_in(seen: Seen) -> BoolArray:
    """Whether each row is a vehicle's first in another lane."""
    same = seen.vehicle[1:] == seen.vehicle[:-1]
    return np.append(False, same & (seen.lane[1:] != seen.lane[:-1]))[: len(seen.vehicle)]


def _just_now(seen: Seen, came_in: BoolArray) -> BoolArray:
    """Whether each row is a vehicle's that came into its lane no longer than a moment ago."""
    found = came_in.copy()
    for rows in range(1, len(came_in)):
        same = seen.vehicle[rows:] == seen.vehicle[:-rows]
        late = same & (seen.time_s[rows:] - seen.time_s[:-rows] <= MOMENT_S)
        if not late.any():
            break
        found[rows:] |= late & came_in[:-rows]
    return found


def _braking_mps2(seen: Seen) -> FloatArray:
    """How hard each vehicle has braked in the last step, positive, 0 in its first."""
    same = seen.vehicle[1:] == seen.vehicle[:-1]
    step_s = np.where(same, np.diff(seen.time_s), np.inf)
    return np.append(0.0, -np.diff(seen.speed_mps) / step_s)[: len(seen.vehicle)]


def _spare_m(seen: Seen, pairs: Pairs, limits: Limits) -> FloatArray:
    """``gap + v_l^2 / (2 b) - v^2 / (2 b)`` of each pair."""
    leader, own = seen.speed_mps[pairs.front], seen.speed_mps[pairs.rear]
    return np.asarray(pairs.gap_m + (leader**2 - own**2) / (2.0 * limits.braking_mps2))


def _pushed_in(seen: Seen, pairs: Pairs, came_in: BoolArray, limits: Limits) -> BoolArray:
    """Where an automated vehicle has come in before a driver, nearer than he brakes for in comfort.

    He has driven on for a step, and he may have sped up in it. While he moves he has s_0 at least.
    A driver who comes in behind it in the same moment has followed it on the ramp, and judges his
    gap himself.
    """
    own, rear = seen.speed_mps[pairs.front], seen.speed_mps[pairs.rear]
    share = np.maximum(0.0, seen.station_m[pairs.front] / limits.lane_end_m)
    shorter_s = (limits.driver_gap_s - limits.least_driver_gap_s) * share**2
    needs_m = limits.driver_gap_m + (limits.driver_gap_s - shorter_s) * rear
    needs_m -= limits.relax_m + limits.relax_at_end_m * share**2
    needs_m += (rear**2 - own**2) / (2.0 * COMFORT_MPS2)
    near_m = np.minimum(limits.driver_gap_m, STANDING_M + limits.driver_gap_s * rear)
    needs_m = np.maximum(needs_m, near_m)
    automated = seen.automated[seen.vehicle]
    found = came_in[pairs.front] & automated[pairs.front]
    found &= ~automated[pairs.rear] & ~_just_now(seen, came_in)[pairs.rear]
    return np.asarray(found & (pairs.gap_m < needs_m - 2.0 * EXACT_M))


def _first_of_each(
    time_s: FloatArray, rear: IntArray, front: IntArray, chosen: BoolArray
) -> list[tuple[float, int, int]]:
    """The first time of each pair of vehicles among the chosen rows."""
    found: dict[tuple[int, int], float] = {}
    for k in np.flatnonzero(chosen):
        found.setdefault((int(rear[k]), int(front[k])), float(time_s[k]))
    return [(t, r, f) for (r, f), t in found.items()]


def _first_of_two(
    touching: Sequence[tuple[float, int, int]],
) -> dict[frozenset[int], tuple[float, int, int]]:
    """The first collision of any two: a simulator lets them drive on, through one another."""
    found: dict[frozenset[int], tuple[float, int, int]] = {}
    for time_s, rear, front in sorted(touching):
        found.setdefault(frozenset((rear, front)), (time_s, rear, front))
    return found


def _over(
    touched: dict[frozenset[int], tuple[float, int, int]], time_s: float, rear: int, front: int
) -> bool:
    """Whether two have collided before: what is between them then tells nothing."""
    pair = frozenset((rear, front))
    return pair in touched and time_s > touched[pair][0]


def _behind_a_wreck(
    touched: dict[frozenset[int], tuple[float, int, int]], pair: tuple[float, int, int]
) -> bool:
    """Whether the vehicle in front has collided before: no brakes stop as a collision does."""
    time_s, _, front = pair
    return any(front in crashed and time_s > first[0] for crashed, first in touched.items())


def _once(broken: Sequence[Broken]) -> list[Broken]:
    """Each driver's deed once, however many steps it takes."""
    found: dict[tuple[int, int, str], Broken] = {}
    for deed in broken:
        found.setdefault((deed.rear, deed.front, deed.what), deed)
    return list(found.values())


def _explained(pair: tuple[float, int, int], broken: Sequence[Broken]) -> bool:
    """Whether a driver's deed explains that an automated vehicle is nearer than it promised."""
    time_s, rear, front = pair
    return any(
        deed.rear == rear
        and deed.front == front
        and deed.time_s <= time_s <= deed.time_s + REMEMBERED_S
        for deed in broken
    )


def _cause(
    pair: tuple[float, int, int],
    automated: BoolArray,
    broken: Sequence[Broken],
    unkept: Sequence[tuple[float, int, int]],
) -> str:
    time_s, rear, front = pair
    if not automated[rear] and not automated[front]:
        return AMONG_DRIVERS
    if automated[rear]:
        return BY_DRIVER if _explained(pair, broken) else BY_AUTOMATED
    pushed = any(r == rear and f == front and t <= time_s for t, r, f in unkept)
    return BY_AUTOMATED if pushed else BY_DRIVER
