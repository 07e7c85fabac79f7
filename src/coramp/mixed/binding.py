"""Which law an automated vehicle's acceleration follows from: the last one that lowered it.

The laws are those of ``on_board``. They are asked again, each time with one more of them.
"""

import math

import numpy as np

from coramp._kernel import FloatArray, IntArray
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import Ahead, Neighbours, driven_mps2
from coramp.mixed.users import NOBODY, RoadUsers

LAWS = (
    "cruises",
    "stops before the lane ends",
    "follows its leader",
    "keeps its distance",
    "does as it is told",
    "makes way for a lane change",
    "stands still, broken down",
)
"""What a vehicle does, in the order in which its acceleration is lowered."""
CRUISES, STOPS, FOLLOWS, KEEPS, TOLD, CHANGES, BROKEN = range(len(LAWS))
NO_LAW = -1
FAR_M = 1e6
LOWER_MPS2 = 1e-9


def binding_laws(
    users: RoadUsers,
    around: Neighbours,
    ahead: Ahead,
    told_mps2: FloatArray,
    changes: np.ndarray,
    laws: OnBoardLaws,
    accel_mps2: FloatArray,
) -> IntArray:
    """Returns the law (a place in ``LAWS``) of each user's ``accel_mps2``, -1 for drivers.

    ``told_mps2`` is the most that each was told to speed up, ``changes`` who changes lanes.
    """
    nobody = np.full(len(users.number), NOBODY)
    alone, led = Neighbours(nobody, nobody, nobody), around._replace(front=nobody, rear=nobody)
    free, none = np.full(len(users.number), math.inf), np.zeros(len(users.number), np.bool_)
    endless = laws._replace(safety=laws.safety._replace(lane_end_m=FAR_M))
    near = laws._replace(safety=laws.safety._replace(margin_m=-FAR_M))
    steps = (
        driven_mps2(users, alone, ahead, free, none, endless),
        driven_mps2(users, alone, ahead, free, none, laws),
        driven_mps2(users, led, ahead, free, none, near),
        driven_mps2(users, led, ahead, free, none, laws),
        driven_mps2(users, led, ahead, told_mps2, none, laws),
        driven_mps2(users, around, ahead, told_mps2, changes, laws),
        accel_mps2,
    )
    found = np.full(len(users.number), CRUISES)
    for law in range(1, len(LAWS)):
        found[steps[law] < steps[law - 1] - LOWER_MPS2] = law
    return np.where(users.automated, found, NO_LAW)
