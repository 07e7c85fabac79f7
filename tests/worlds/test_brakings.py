"""When drivers brake for nothing: a Poisson process that is known before the run."""

import numpy as np
import pytest

from coramp.worlds.faults.brakings import MANY, due_s
from tests.worlds.test_careless import driven


def test_times_are_those_of_a_poisson_process():
    counts = np.array([len(due_s(120.0, seed, 600.0)) for seed in range(2000)])
    assert counts.mean() == pytest.approx(20.0, abs=4.0 * np.sqrt(20.0 / 2000.0))
    assert counts.var() == pytest.approx(20.0, rel=0.15)
    every_s = np.concatenate([due_s(120.0, seed, 600.0) for seed in range(2000)])
    assert every_s.mean() == pytest.approx(300.0, abs=5.0)
    assert every_s.min() >= 0.0
    assert every_s.max() <= 600.0


def test_a_longer_time_has_the_same_first_times():
    short_s, long_s = due_s(3600.0, 3, 100.0), due_s(3600.0, 3, 2000.0)
    assert len(long_s) > MANY
    assert np.array_equal(long_s[: len(short_s)], short_s)
    assert long_s[len(short_s)] > 100.0
    assert np.all(np.diff(long_s) > 0.0)
    assert np.array_equal(due_s(1800.0, 3, 200.0), 2.0 * short_s)


def test_nobody_brakes_at_no_rate():
    assert len(due_s(0.0, 3, 1e9)) == 0


def test_a_run_has_the_brakings_that_are_due_until_vehicles_stop_arriving():
    rate = {"behaviour.brakes_for_nothing_per_h": 300.0}
    tables, _ = driven(rate, share=0.25, mainline_veh_h=2000.0)
    events = tables.safety_events.filter(event="driver brakes for nothing")["time_s"].to_numpy()
    expected_s = due_s(300.0, 3, 120.0)
    assert len(events) == len(expected_s)
    late_s = events - expected_s
    assert late_s.min() >= -1e-9
    assert np.median(late_s) <= 0.2  # one is near the merge, all but at the start
