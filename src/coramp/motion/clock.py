"""The control clock: step k is at ``k step_s``."""

import numpy as np

from coramp._kernel import kernel

ON_GRID = 1e-6
"""Share of a step within which a time counts as lying on it."""


@kernel
def first_step_from(time_s: float, step_s: float) -> int:
    """Returns the first step at or after a time."""
    return int(np.ceil(time_s / step_s - ON_GRID))
