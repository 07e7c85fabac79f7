"""Vehicles and numbers of mixed traffic for tests: written out, so that tuning moves no test."""

import numpy as np

from coramp.mixed.laws import CourtesyLaws, FollowingLaw, OnBoardLaws, SafetyLaw, SequenceLaw
from coramp.mixed.on_board import Ahead
from coramp.mixed.users import Gaps, MixedRoad, RoadUsers

ROAD = MixedRoad(mainline_speed_mps=20.0, ramp_speed_mps=16.0, ramp_limit_mps=16.67)
GAPS = Gaps(
    behind_automated_m=2.0,
    behind_automated_s=0.5,
    behind_driver_m=2.5,
    behind_driver_s=0.8,
    of_driver_m=2.5,
    of_driver_s=1.0,
    for_driver_m=2.5,
    for_driver_s=1.3,
    least_of_driver_s=1.0,
)
FOLLOWING = FollowingLaw(
    gap_gain_ps2=0.5,
    speed_gain_ps=1.0,
    feed_forward=0.5,
    courtesy_gap_gain_ps2=0.1,
    courtesy_speed_gain_ps=0.5,
    courtesy_mps2=2.0,
    early_share=0.5,
    early_s=4.0,
    speed_up_mps2=2.5,
    merge_mps2=2.0,
)
SEQUENCE = SequenceLaw(
    own_weight=1.0,
    driver_weight=2.0,
    hysteresis_m=2.0,
    deep=6.0,
    behind_m=100.0,
    ahead_m=100.0,
    slowest_share=0.6,
    slowest_ramp_share=0.9,
    urgent_m=100.0,
    urgent_mps=3.0,
)
SAFETY = SafetyLaw(
    braking_mps2=6.0,
    reaction_s=0.3,
    margin_m=1.0,
    hardest_mps2=8.0,
    stop_mps2=2.0,
    lane_end_m=197.0,
    driver_mps2=4.5,
    relax_m=1.5,
    relax_at_end_m=0.0,
    gentle_mps2=0.6,
    gentle_at_end_mps2=5.0,
)

ON_BOARD = OnBoardLaws(GAPS, FOLLOWING, SAFETY, ROAD, period_s=0.2)
COURTESY = CourtesyLaws(GAPS, SEQUENCE, FOLLOWING, ROAD, period_s=0.2)


def users_of(rows):
    """Returns road users from rows of station (m), speed (m/s), on the mainline, automated.

    A row may go on with a length (m), the brakes (m/s2) that the vehicle relies on, and its
    acceleration (m/s2).
    """
    full = [(*row, *(5.0, 6.0, 0.0)[len(row) - 4 :]) for row in rows]
    count = len(full)
    return RoadUsers(
        np.arange(count, dtype=np.int64) + 100,
        np.array([row[0] for row in full], np.float64),
        np.array([row[1] for row in full], np.float64),
        np.array([row[6] for row in full], np.float64),
        np.array([row[4] for row in full], np.float64),
        np.array([row[2] for row in full], np.bool_),
        np.array([row[3] for row in full], np.bool_),
        np.full(count, 20.0),
        np.full(count, 2.5),
        np.full(count, np.inf),
        np.array([row[5] for row in full], np.float64),
    )


def at_once(users):
    """Returns where vehicles are when a command acts that acts at once."""
    return Ahead(np.zeros(len(users.number)), users.speed_mps, 0.0)
