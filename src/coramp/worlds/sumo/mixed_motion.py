"""How vehicles of a mixed run move from one decision to the next: as sent, and as measured."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel


class Motion(NamedTuple):
    """What is remembered of all vehicles of a run, one entry each; nan before the first time.

    ``sent_m`` and ``sent_mps`` are where an automated vehicle was sent, and how fast it is to be
    there. ``was_mps`` and ``accel_mps2`` are speed and smoothed acceleration at the last decision.
    ``largest_error_m`` is how far it was from where it was sent.
    """

    sent_m: FloatArray
    sent_mps: FloatArray
    was_mps: FloatArray
    accel_mps2: FloatArray
    largest_error_m: FloatArray


@kernel
def measured(
    number: IntArray,
    station_m: FloatArray,
    speed_mps: FloatArray,
    motion: Motion,
    period_s: float,
    share: float,
) -> tuple[FloatArray, FloatArray]:
    """Returns speeds (m/s) and smoothed accelerations (m/s2) of who is on the road; notes both.

    The speed of an automated vehicle is the one that it was sent with. ``share`` of the change
    since the last decision, a ``period_s`` ago, counts. The acceleration of who is new is 0.
    """
    now_mps, accel_mps2 = np.empty(len(number)), np.empty(len(number))
    for k in range(len(number)):
        own = number[k]
        now_mps[k] = speed_mps[k]
        if not math.isnan(motion.sent_mps[own]):
            now_mps[k] = motion.sent_mps[own]
            error_m = abs(station_m[k] - motion.sent_m[own])
            motion.largest_error_m[own] = max(motion.largest_error_m[own], error_m)
        was_mps = motion.was_mps[own]
        since_mps = 0.0 if math.isnan(was_mps) else now_mps[k] - was_mps
        motion.accel_mps2[own] += share * (since_mps / period_s - motion.accel_mps2[own])
        motion.was_mps[own] = now_mps[k]
        accel_mps2[k] = motion.accel_mps2[own]
    return now_mps, accel_mps2


@kernel
def sent_evenly(
    number: IntArray, accel_mps2: FloatArray, motion: Motion, steps: int, step_s: float
) -> tuple[FloatArray, FloatArray]:
    """Returns the speeds (m/s) to command so that vehicles change speed evenly; notes their ends.

    They are v - a h / 2 and v + a (n - 1/2) h for n steps of h; nobody drives backwards.
    """
    from_mps, to_mps = np.empty(len(number)), np.empty(len(number))
    time_s, half_s = steps * step_s, 0.5 * step_s
    for k in range(len(number)):
        own = number[k]
        before_mps = motion.sent_mps[own]
        after_mps = max(0.0, before_mps + accel_mps2[k] * time_s)
        accel = (after_mps - before_mps) / time_s
        motion.sent_mps[own] = after_mps
        motion.sent_m[own] += 0.5 * (before_mps + after_mps) * time_s
        from_mps[k] = before_mps - accel * half_s
        to_mps[k] = max(0.0, after_mps - accel * half_s)
    return from_mps, to_mps
