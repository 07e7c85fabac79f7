"""From pieces to commands: what SUMO must be told, and at which step.

Under the ballistic method a vehicle covers the mean of its speeds at the two ends of a step, so a
stretch of constant acceleration between two steps is driven exactly, with one command. A knot that
falls inside a step gets a command for that step alone, to the speed that the plan has at its end;
the way then differs from the plan by ``|da| x (step - x) / 2``, where the acceleration changes by
``da`` at x into the step: at most ``|da| step^2 / 8``.
"""

import math

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import ACCEL, SPEED, piece_at, piece_end_s, station_and_speed
from coramp.motion.clock import ON_GRID

ROUNDING_MPS = 1e-9
"""By so much rounding may leave a speed below 0 where a plan comes to a stand."""


@kernel
def command_table(pieces: FloatArray, step_s: float, from_step: int) -> FloatArray:
    """Returns the commands that drive a trajectory, shape (n, 5), by step.

    Columns are step, speed, steps, and where and how fast the plan has the vehicle at that step.

    At ``step`` go to ``speed`` (m/s) evenly over ``steps``; 0 steps means to keep it from now on.
    The first command is for ``from_step``. The trajectory must end in a cruise or at a stand.
    """
    out = np.empty((4 * len(pieces) + 4, 5))
    n = 0
    step = from_step
    last = len(pieces) - 1
    while True:
        now_s = step * step_s
        k = piece_at(pieces, now_s + ON_GRID * step_s)
        out[n, 0] = step
        out[n, 3], out[n, 4] = station_and_speed(pieces, now_s)
        if k == last:
            out[n, 1], out[n, 2] = forwards_mps(pieces[last, SPEED]), 0
            return out[: n + 1]
        whole = math.floor(piece_end_s(pieces, k) / step_s + ON_GRID) - step
        steps = max(1, whole)
        _, speed_mps = station_and_speed(pieces, now_s + steps * step_s)
        out[n, 1] = forwards_mps(speed_mps)
        out[n, 2] = 0 if whole >= 1 and pieces[k, ACCEL] == 0.0 else steps
        n += 1
        step += steps


@kernel
def correction(
    pieces: FloatArray, step_s: float, step: int, error_m: float, speed_mps: float, most_steps: int
) -> FloatArray:
    """Returns two commands that bring a vehicle back onto its plan, none if a knot is too near.

    At ``step`` it drives ``speed_mps`` and is ``error_m`` ahead. Both commands take h steps, at
    most ``most_steps``, within one piece. With u the speed between them the way is
    ``h step_s (v / 2 + u + w / 2)``, w the plan's speed at the end.
    """
    out = np.empty((2, 5))
    k = piece_at(pieces, (step + ON_GRID) * step_s)
    left = most_steps * 2.0
    if k + 1 < len(pieces):
        left = min(left, math.floor(piece_end_s(pieces, k) / step_s + ON_GRID) - step)
    h = int(left) // 2
    if h < 1:
        return out[:0]
    now_m, now_mps = station_and_speed(pieces, step * step_s)
    middle_m, middle_mps = station_and_speed(pieces, (step + h) * step_s)
    then_m, then_mps = station_and_speed(pieces, (step + 2 * h) * step_s)
    between_mps = (then_m - now_m - error_m) / (h * step_s) - 0.5 * (speed_mps + then_mps)
    if between_mps < 0.0:
        return out[:0]
    out[0] = np.array((float(step), between_mps, float(h), now_m, now_mps))
    out[1] = np.array((float(step + h), forwards_mps(then_mps), float(h), middle_m, middle_mps))
    return out


@kernel
def forwards_mps(speed_mps: float) -> float:
    """Returns the speed to command: 0 where rounding has it below that as a plan comes to rest."""
    return 0.0 if -ROUNDING_MPS < speed_mps < 0.0 else speed_mps
