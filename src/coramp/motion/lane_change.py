"""When a vehicle changes lanes: at a step of the control clock, as a simulator does it."""

from typing import TypeVar

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.motion.clock import ON_GRID

Time = TypeVar("Time", float, FloatArray)


@kernel
def lane_change_s(time_s: Time, step_s: float) -> Time:
    """Returns the first step (s) at or after a time, or after each of an array of times.

    A vehicle that is to merge between two steps changes lanes at the later one. Until then it is on
    the acceleration lane, where Eq. 1 holds to the vehicle ahead of it there.
    """
    return np.ceil(time_s / step_s - ON_GRID) * step_s  # type: ignore[no-any-return]
