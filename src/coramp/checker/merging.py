"""How the checker tells whether and when a vehicle comes onto the mainline.

A merge time is a time (s), or one of two values that are none and are compared here alone.
"""

import math

from coramp._kernel import kernel

ON_IT_AT_ENTRY = -math.inf
"""In place of the merge time of a vehicle that enters on the mainline."""
NOT_COMMANDED = math.inf
"""In place of the merge time of a ramp vehicle while no merge is commanded."""


@kernel
def merge_at_entry_s(on_ramp: bool) -> float:
    """Returns the merge time of a vehicle that enters by the ramp, or on the mainline."""
    return NOT_COMMANDED if on_ramp else ON_IT_AT_ENTRY


@kernel
def comes_onto_mainline(merge_s: float) -> bool:
    """Returns whether a vehicle is on the mainline at some time; False while it is to stop."""
    return merge_s < NOT_COMMANDED
