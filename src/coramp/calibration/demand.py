"""Who would come, where detectors count only who gets through."""

import numpy as np

from coramp._kernel import BoolArray, FloatArray

BEFORE = 3
"""Over so many intervals demand before a queue is averaged."""


def saturated(counts: FloatArray, queue: BoolArray) -> FloatArray:
    """Returns counts (whole numbers) with those of a queue at the detector raised.

    A detector that stands in a queue counts what the merge lets through and not who would come:
    that is taken to be what came in the last intervals without a queue, or what was counted where
    that is more.
    """
    result = counts.copy()
    for k in np.flatnonzero(queue):
        free = np.flatnonzero(~queue[:k])[-BEFORE:]
        if len(free):
            result[k] = max(counts[k], counts[free].mean())
    return np.rint(result)
