"""When a merge breaks down, by traffic made by hand."""

import numpy as np
import pytest

import coramp
from coramp.metrics.queues import crossings, queue_figures
from coramp.records.lanes import planned_history
from coramp.records.outcome import Outcome, Passages, Pieces
from coramp.scenarios.loading import load_scenario

ROAD_M = 800.0


def scenario(horizon_s=3600.0, **overrides):
    return load_scenario("paper", {"simulation.horizon_s": horizon_s, **overrides})


def outcome(groups, ramp=False):
    """Returns an outcome of vehicles (entry, speed), each at its own speed all along."""
    vehicles = sorted(groups)
    entry_s, speed_mps = np.array(vehicles).T
    count = len(vehicles)
    rows = np.column_stack([entry_s, np.full(count, -400.0), speed_mps, np.zeros(count)])
    exit_s = entry_s + ROAD_M / speed_mps
    nothing = np.full(count, np.nan)
    passages = Passages(
        tuple(f"m{k:05d}" for k in range(count)),
        np.full(count, ramp),
        np.full(count, 5.0),
        entry_s,
        speed_mps,
        entry_s,
        np.full(count, -np.inf),
        exit_s,
        nothing,
    )
    pieces = Pieces(np.arange(count + 1), rows)
    lanes = planned_history(passages.on_ramp, entry_s, passages.merge_s, exit_s)
    lane = np.full(count, 2)
    return Outcome(False, passages, pieces, lane, pieces, lanes, float(exit_s.max()), 0)


def passing(from_s, to_s, every_s, speed_mps):
    """Vehicles that pass the loop 200 m upstream from one time to another, evenly."""
    times_s = np.arange(from_s, to_s - 1e-9, every_s) + 0.5 * every_s
    return [(float(t - 200.0 / speed_mps), speed_mps) for t in times_s]


FREE = passing(0.0, 1800.0, 2.0, 20.0)
QUEUE = passing(1800.0, 3600.0, 3.0, 10.0)


def test_breakdown_the_flow_before_and_the_discharge_by_hand():
    found = queue_figures(outcome(FREE + QUEUE), scenario())
    assert found["breakdown_time_s"] == 1800.0
    assert found["prebreakdown_flow_veh_h"] == pytest.approx(1800.0, abs=4.0)
    # those who leave in its first 30 s are still from before, and nobody in the 30 s after these
    assert found["discharge_flow_veh_h"] == pytest.approx(1200.0 - 10.0, abs=4.0)


@pytest.mark.parametrize(("speed_mps", "breaks"), [(15.01, False), (14.99, True)])
def test_a_queue_is_a_quarter_slower_than_free_flow(speed_mps, breaks):
    slow = passing(1800.0, 3600.0, 3.0, speed_mps)
    found = queue_figures(outcome(FREE + slow), scenario())
    assert (found["breakdown_time_s"] == 1800.0) == breaks
    assert (found["discharge_flow_veh_h"] is None) != breaks


def test_a_queue_of_ten_minutes_is_no_breakdown():
    short = FREE + passing(1800.0, 2400.0, 3.0, 10.0) + passing(2400.0, 3600.0, 2.0, 20.0)
    assert set(queue_figures(outcome(short), scenario()).values()) == {None}
    long = FREE + passing(1800.0, 2700.0, 3.0, 10.0) + passing(2700.0, 3600.0, 2.0, 20.0)
    found = queue_figures(outcome(long), scenario())
    assert found["breakdown_time_s"] == 1800.0
    # of the free intervals after it none counts
    assert found["discharge_flow_veh_h"] == pytest.approx(1200.0, abs=30.0)


def test_only_what_lies_within_the_horizon_counts():
    assert queue_figures(outcome(FREE + QUEUE), scenario(2600.0))["breakdown_time_s"] is None
    assert queue_figures(outcome(FREE + QUEUE), scenario(2700.0))["breakdown_time_s"] == 1800.0


def test_there_is_no_flow_before_within_the_first_quarter_of_an_hour():
    early = passing(0.0, 600.0, 2.0, 20.0) + passing(600.0, 3600.0, 3.0, 10.0)
    found = queue_figures(outcome(early), scenario())
    assert found["breakdown_time_s"] == 600.0
    assert found["prebreakdown_flow_veh_h"] is None
    assert found["discharge_flow_veh_h"] is not None


def test_a_queue_that_stands_lasts():
    stands = FREE + passing(1800.0, 2100.0, 3.0, 10.0) + passing(2700.0, 3600.0, 3.0, 10.0)
    assert queue_figures(outcome(stands), scenario())["breakdown_time_s"] == 1800.0
    nobody = FREE + passing(2700.0, 3600.0, 3.0, 10.0)
    assert queue_figures(outcome(nobody), scenario())["breakdown_time_s"] == 2700.0


def test_the_ramps_vehicles_do_not_pass_the_mainlines_loop():
    found = queue_figures(outcome(FREE + QUEUE, ramp=True), scenario())
    assert found["breakdown_time_s"] is None


def test_passing_a_station_is_solved_within_the_piece():
    # from -10 m at 2 m/s, 1 m/s2: 10 m take 2 (sqrt(1 + 5) - 1) s; then a cruise that never ends
    rows = np.array([[5.0, -10.0, 2.0, 1.0], [9.0, 6.0, 6.0, 0.0], [0.0, -3.0, 1.0, -1.0]])
    driven = Pieces(np.array([0, 2, 2, 3]), rows)
    time_s, speed_mps = crossings(driven, np.array([0, 1, 2]), 0.0)
    assert time_s == pytest.approx([5.0 + 2.0 * (6.0**0.5 - 1.0)])
    assert speed_mps == pytest.approx([24.0**0.5])
    later_s, _ = crossings(driven, np.array([0]), 12.0)
    assert later_s == pytest.approx([10.0])
    assert len(crossings(driven, np.array([2]), -2.6)[0]) == 1  # stops at -2.5 m
    assert len(crossings(driven, np.array([1, 2]), 0.0)[0]) == 0


def test_a_run_tells_it():
    quiet = coramp.run("paper", "mainline-priority", engine="exact", horizon_s=1200.0)
    assert quiet.summary["breakdown_time_s"] is None
    settings = {"simulation.drain_s": 1.0, "ramp.flow_to_veh_h": 1500.0}
    busy = coramp.run(
        "paper",
        "uncontrolled",
        drivers="credible",
        mainline_veh_h=1500.0,
        ramp_veh_h=300.0,
        horizon_s=2700.0,
        overrides=settings,
    ).summary
    assert 600.0 <= busy["breakdown_time_s"] <= 1800.0
    assert 1700.0 < busy["discharge_flow_veh_h"] < 2200.0
