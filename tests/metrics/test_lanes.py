"""The lane history: who was on which lane from when to when, by plan and as seen."""

import numpy as np

from coramp.metrics.several_lanes import changed_further_in
from coramp.records.lanes import first_on_mainline_s, planned_history, seen_history
from coramp.vehicles.merge_state import BY_MAINLINE_S

NEVER = np.nan
ON_RAMP = np.array([False, True, True, False])
ENTRY_S = np.array([1.0, 2.0, 3.0, NEVER])
MERGE_S = np.array([BY_MAINLINE_S, 9.0, NEVER, BY_MAINLINE_S])
UNTIL_S = np.array([20.0, 30.0, 50.0, 50.0])


def stays(history):
    """The stays that began, as rows of vehicle, from, until and whether it merged."""
    rows = zip(history.vehicle, history.from_s, history.until_s, history.merged, strict=True)
    return [tuple(row) for row in rows if row[1] < row[2]]


def test_plans_change_lanes_once_or_never():
    history = planned_history(ON_RAMP, ENTRY_S, MERGE_S, UNTIL_S)
    assert stays(history.on(mainline=True)) == [(0, 1.0, 20.0, False), (1, 9.0, 30.0, True)]
    assert stays(history.on(mainline=False)) == [(1, 2.0, 9.0, False), (2, 3.0, 50.0, False)]


def test_who_overtakes_on_the_acceleration_lane_comes_back():
    vehicle = np.array([0, 0, 0, 0, 1, 1, 1])
    lane = np.array([0, -1, -1, 0, -1, -1, 0])
    time_s = np.array([1.0, 2.0, 3.0, 4.0, 2.0, 3.0, 4.0])
    history = seen_history(vehicle, lane, time_s, np.array([5.0, 6.0]))
    assert stays(history.on(mainline=True)) == [
        (0, 1.0, 2.0, False),
        (0, 4.0, 5.0, True),
        (1, 4.0, 6.0, True),
    ]
    assert stays(history.on(mainline=False)) == [(0, 2.0, 4.0, False), (1, 2.0, 4.0, False)]


def test_the_first_time_on_the_mainline_is_that_of_the_first_stay():
    vehicle, lane = np.array([0, 0, 0, 2]), np.array([0, -1, 0, -1])
    history = seen_history(vehicle, lane, np.arange(4.0), np.full(3, 9.0))
    np.testing.assert_array_equal(first_on_mainline_s(history, 3), [0.0, NEVER, NEVER])


def test_lanes_of_the_mainline_have_histories_of_their_own():
    vehicle = np.array([0, 0, 0, 0, 1, 1, 2, 2])
    lane = np.array([-1, 0, 1, 0, 0, 1, 2, 1])
    history = seen_history(vehicle, lane, np.arange(8.0), np.full(3, 9.0))
    assert history.lanes == [0, 1, 2, -1]
    assert stays(history.in_lane(0)) == [
        (0, 1.0, 2.0, True),
        (0, 3.0, 9.0, False),
        (1, 4.0, 5.0, False),
    ]
    assert stays(history.in_lane(1)) == [
        (0, 2.0, 3.0, False),
        (1, 5.0, 9.0, False),
        (2, 7.0, 9.0, False),
    ]
    # from the ramp onto the mainline is a merge, back to the lane further out makes no way
    assert changed_further_in(history).tolist() == [0, 1]


def test_nobody_ever_drove():
    nothing = np.empty(0)
    history = seen_history(nothing.astype(int), nothing.astype(int), nothing, np.full(2, 9.0))
    assert stays(history) == []
    np.testing.assert_array_equal(first_on_mainline_s(history, 2), [NEVER, NEVER])
