"""Which law bound a vehicle, and where in the order of passing it was."""

import numpy as np
import pytest

from coramp.mixed import binding as b
from coramp.mixed.on_board import driven_mps2, neighbours_of
from coramp.worlds.sumo.mixed_notes import order_of
from tests.mixed.roads import ON_BOARD, at_once, users_of


def law_of(rows, told_mps2=np.inf, changes=(), broken_mps2=None):
    """Returns the laws of vehicles, the first of which is told how much it may speed up."""
    users = users_of(rows)
    around, ahead = neighbours_of(users), at_once(users)
    told = np.full(len(rows), np.inf)
    told[0] = told_mps2
    change = np.isin(np.arange(len(rows)), changes)
    accel_mps2 = driven_mps2(users, around, ahead, told, change, ON_BOARD)
    if broken_mps2 is not None:
        accel_mps2[0] = broken_mps2
    return b.binding_laws(users, around, ahead, told, change, ON_BOARD, accel_mps2)


ALONE = (-200.0, 20.0, True, True)


@pytest.mark.parametrize(
    ("rows", "more", "law"),
    [
        ([ALONE], {}, b.CRUISES),
        ([(190.0, 8.0, False, True)], {}, b.STOPS),
        ([ALONE, (-183.0, 20.0, True, True)], {}, b.CRUISES),
        ([ALONE, (-184.0, 19.5, True, True)], {}, b.FOLLOWS),
        ([ALONE, (-189.0, 10.0, True, True)], {}, b.KEEPS),
        ([ALONE], {"told_mps2": -0.5}, b.TOLD),
        ([(100.0, 16.0, False, True), (110.0, 15.0, True, True)], {"changes": [0]}, b.CHANGES),
        ([(80.0, 20.0, True, True), (95.0, 16.0, False, True)], {"changes": [1]}, b.CHANGES),
        ([ALONE], {"broken_mps2": -3.0}, b.BROKEN),
        ([(-200.0, 20.0, True, False)], {}, b.NO_LAW),
    ],
)
def test_the_law_that_lowered_the_acceleration_last_is_told(rows, more, law):
    assert law_of(rows, **more)[0] == law


def test_the_order_has_ramp_vehicles_where_they_were_placed():
    rows = [(x, 20.0, True, True) for x in (50.0, 0.0, -50.0)]
    rows += [(x, 16.0, False, True) for x in (20.0, -10.0, -60.0)]
    seen = users_of(rows)._replace(number=np.array([0, 1, 2, 3, 4, 5]))
    place, after = order_of(seen, ((3, -1), (4, 0), (5, 4)), 7)
    assert place.tolist() == [2, 5, 6, 1, 3, 4, 0]
    assert after.tolist() == [3, 5, 1, -1, 0, 4, -1]
