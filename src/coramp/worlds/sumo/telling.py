"""What cooperative vehicles tell of themselves in SUMO, besides their reports once a second."""

import numpy as np

from coramp._kernel import IntArray
from coramp.messages.log import NO_POSITIONS, Positions
from coramp.worlds.sumo.cooperative import CooperativePlant
from coramp.worlds.telling import together


def positions_in_sumo(
    plant: CooperativePlant, vehicle_of_row: IntArray, step_s: float
) -> Positions:
    """Returns a report at each change of acceleration, and the comparisons with the plan.

    What drives on from a measured position, and is told a step later, is of that earlier time.
    """
    parts = [NO_POSITIONS]
    if plant.driven:
        rows = np.array(plant.driven)
        steps = np.rint(rows[:, 1] / step_s).astype(np.int64)
        of_s = rows[:, 1].copy()
        of_s[plant.carried_on] = (steps[plant.carried_on] - 1) * step_s
        parts.append(
            Positions(
                vehicle_of_row[rows[:, 0].astype(np.int64)],
                steps,
                of_s,
                rows[:, 2],
                rows[:, 3],
                rows[:, 4],
                np.zeros(len(rows), np.bool_),
            )
        )
    if plant.compared:
        rows = np.array(plant.compared)
        steps = rows[:, 1].astype(np.int64)
        parts.append(
            Positions(
                vehicle_of_row[rows[:, 0].astype(np.int64)],
                steps,
                np.asarray(steps * step_s, np.float64),
                rows[:, 2],
                rows[:, 3],
                np.full(len(rows), np.nan),
                np.ones(len(rows), np.bool_),
            )
        )
    return together(parts)
