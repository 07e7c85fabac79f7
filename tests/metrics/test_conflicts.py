"""Conflicts from positions made up by hand: each kind, and the same without it."""

import math

import numpy as np
import pytest

from coramp.checker.among_drivers import Seen
from coramp.equations.conflict_risk import severity_of_masses_m2ps4
from coramp.metrics.conflicts import conflicts_of

STEP_S = 0.1
LENGTH_M = 5.0
STEPS = 40


def way(station_m, speed_mps, accel_mps2=0.0, in_lane_from=0):
    """Rows (time, station, speed, on the mainline) of a vehicle."""
    times_s = STEP_S * np.arange(STEPS)
    speeds_mps = np.maximum(0.0, speed_mps + accel_mps2 * times_s)
    moved_m = np.concatenate([[0.0], np.cumsum(0.5 * (speeds_mps[1:] + speeds_mps[:-1]) * STEP_S)])
    return np.column_stack(
        [times_s, station_m + moved_m, speeds_mps, np.arange(STEPS) >= in_lane_from]
    )


def found_in(*ways, mass_kg=1500.0):
    rows = np.concatenate(ways)
    first = STEPS * np.arange(len(ways) + 1)
    seen = Seen(
        np.repeat(np.arange(len(ways)), STEPS),
        rows[:, 0],
        rows[:, 1],
        rows[:, 2],
        np.where(rows[:, 3] > 0.5, 0, -1),
        np.full(len(ways), LENGTH_M),
        np.zeros(len(ways), np.bool_),
    )
    masses_kg = np.broadcast_to(np.asarray(mass_kg, np.float64), len(ways))
    return conflicts_of(seen, first, masses_kg)


def test_a_pair_counts_once_with_its_smallest_ttc_and_largest_drac():
    # 25 m apart, 5 m/s nearer: after 3.9 s 5.5 m are left
    found = found_in(way(30.0, 15.0), way(0.0, 20.0))
    assert found.ttc_s == pytest.approx([5.5 / 5.0])
    assert found.drac_mps2 == pytest.approx([0.5 * 25.0 / 5.5])
    counts = found.counts()
    assert [counts[f"conflicts_ttc_{name}"] for name in ("3", "1_5", "1")] == [1, 1, 0]
    assert [counts[f"conflicts_drac_{name}"] for name in ("2", "3_4", "6")] == [1, 0, 0]


def test_who_does_not_close_in_or_is_in_another_lane_has_no_conflict():
    opens = found_in(way(30.0, 20.0), way(0.0, 15.0))
    beside = found_in(way(30.0, 15.0), way(0.0, 20.0, in_lane_from=STEPS))
    for found in (opens, beside):
        assert len(found.ttc_s) == len(found.pet_s) == 0
        assert set(found.counts().values()) == {0}


def test_vehicles_that_overlap_are_the_gravest_of_all():
    found = found_in(way(6.0, 10.0), way(0.0, 20.0))
    assert (found.ttc_s.tolist(), found.drac_mps2.tolist()) == ([0.0], [math.inf])


def test_pet_is_from_one_rear_that_leaves_to_the_other_front_that_arrives():
    # all at 20 m/s; the one who comes in at 1 s is 8 m behind a rear and 4 m ahead of a front
    front, own, rear = way(13.0, 20.0), way(0.0, 20.0, in_lane_from=10), way(-9.0, 20.0)
    found = found_in(front, own, rear)
    assert sorted(found.pet_s) == pytest.approx([4.0 / 20.0, 8.0 / 20.0])
    assert set(found.severity_m2ps4) == {0.0}


def test_who_never_reaches_the_place_has_no_pet():
    found = found_in(way(0.0, 20.0, in_lane_from=10), way(-200.0, 5.0))
    assert found.pet_s.tolist() == [math.inf]


def test_severity_is_that_of_masses_speeds_and_distance_at_the_lane_change():
    front, own = way(40.0, 10.0), way(0.0, 20.0, in_lane_from=10)
    found = found_in(front, own, mass_kg=[9000.0, 1500.0])
    gap_m = 40.0 + 10.0 - LENGTH_M - 20.0
    _, relative = severity_of_masses_m2ps4(20.0, 10.0, gap_m, 1500.0, 9000.0)
    assert found.severity_m2ps4 == pytest.approx([relative])
    counts = found.counts()
    assert [counts[f"conflicts_j_{name}"] for name in (1, 10, 100)] == [1, 0, 0]
