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
from coramp.core.trajectory import ACCEL, SPEED, TIME, piece_at, piece_end_s, station_and_speed

ON_GRID = 1e-6
"""Share of a step within which a knot counts as lying on it."""


@kernel
def command_table(pieces: FloatArray, step_s: float) -> FloatArray:
    """Returns the commands that drive a trajectory, shape (n, 4): step, speed, steps, station.

    At ``step`` go to ``speed`` (m/s) evenly over ``steps``; 0 steps means to keep it from now on.
    ``station`` (m) is where the plan has the vehicle at ``step``. The trajectory must start on a
    step and end in a cruise or at a stand.
    """
    out = np.empty((4 * len(pieces) + 4, 4))
    n = 0
    step = round(pieces[0, TIME] / step_s)
    last = len(pieces) - 1
    while True:
        now_s = step * step_s
        k = piece_at(pieces, now_s + ON_GRID * step_s)
        station_m, _ = station_and_speed(pieces, now_s)
        out[n, 0], out[n, 3] = step, station_m
        if k == last:
            out[n, 1], out[n, 2] = pieces[last, SPEED], 0
            return out[: n + 1]
        whole = math.floor(piece_end_s(pieces, k) / step_s + ON_GRID) - step
        steps = max(1, whole)
        _, out[n, 1] = station_and_speed(pieces, now_s + steps * step_s)
        out[n, 2] = 0 if whole >= 1 and pieces[k, ACCEL] == 0.0 else steps
        n += 1
        step += steps
