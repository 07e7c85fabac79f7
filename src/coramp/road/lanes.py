"""The lanes at a merge: their names, and the codes that arrays and kernels use for them."""

LANES = ("ramp", "acceleration", "mainline")
"""Names of the lanes, in the order of their codes: before the nose, beside and on the mainline."""
LANE_CHANGE_LASTS_S = 4.5
"""How long a change to the mainline's next lane takes, while a vehicle counts on both lanes.

Over the 3.2 m of SUMO's lanes, a lateral acceleration that is a sine has a peak of
2 pi w / T^2 = 0.99 m/s2. UN R79 allows 1 m/s2 for an automated change of lanes, and 5 s.
"""
RAMP, ACCELERATION_LANE, MAINLINE = range(len(LANES))
"""Codes of the lanes: where pieces lie, and how far a vehicle's merge has come."""


def lane_name(code: int) -> str:
    """Returns the name of a lane by its code; beyond the last are the mainline's lanes further in.

    ``mainline`` is the lane next to the ramp, ``mainline 2`` the one beside it.
    """
    return LANES[code] if code <= MAINLINE else f"{LANES[MAINLINE]} {code - MAINLINE + 1}"


def mainline_lane(name: str) -> int:
    """Returns which lane of the mainline a name is: 0 next to the ramp; -1 where it is none."""
    road, _, number = name.partition(" ")
    if road != LANES[MAINLINE]:
        return -1
    return int(number) - 1 if number else 0
