"""Merges from a cruise at v0, long after that was reached and close to the lane's end."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from coramp.scenarios.loading import load_scenario
from coramp.strategies.base import Decision, FollowTrajectory
from coramp.strategies.proposals import find_unsafe_pair, propose_merge
from coramp.strategies.situation import assess
from coramp.vehicles.fleet import empty_proposal
from coramp.worlds.sumo.engine import run_cooperative
from coramp.worlds.sumo.files import SumoOptions


@dataclass(frozen=True)
class LateMerge:
    """Free movement up to v0, then a cruise on the acceleration lane up to ``station_m``."""

    station_m: float
    name: ClassVar[str] = "late-merge"
    summary: ClassVar[str] = "merges long after v0 is reached"
    cooperative: ClassVar[bool] = True

    def decide(self, view, memory):
        row, rules = view.subjects[0], view.rules
        rest = tuple((view.time_s, other) for other in view.subjects[1:])
        situation = assess(view.fleet, row, view.time_s, view.fastest_entry_mps, rules)
        proposal = empty_proposal()
        propose_merge(proposal, row, situation.approach, situation.free_accel_mps2, rules)
        merge_s = (self.station_m - situation.free_m) / rules.road.mainline_speed_mps
        reached_s, proposal.merge_time_s[0] = proposal.merge_time_s[0], merge_s
        unsafe, _ = find_unsafe_pair(view.fleet, proposal, situation.from_s, rules)
        if unsafe >= 0 or merge_s < reached_s:
            again = (view.time_s + rules.control.retry_s, row)
            return Decision((), (*rest, again))
        pieces = proposal.pieces[0, : proposal.piece_count[0]].copy()
        return Decision((FollowTrajectory(row, pieces, merge_s),), rest)


@pytest.mark.parametrize(
    ("scenario", "station_m"),
    [
        *(("paper", station_m) for station_m in (60.0, 120.0, 180.0, 195.0, 197.5)),
        *(("expressway", station_m) for station_m in (175.0, 196.7)),
    ],
)
def test_vehicle_that_merges_late_stays_on_its_plan(scenario, station_m):
    road = load_scenario(
        scenario,
        {
            "mainline.flow_veh_h": 1000.0,
            "ramp.flow_veh_h": 300.0,
            "simulation.horizon_s": 120.0,
        },
    )
    outcome = run_cooperative(road, LateMerge(station_m), 3, SumoOptions())
    seen = outcome.passages
    merged = np.isfinite(seen.merge_s)
    assert merged.sum() >= 5
    assert np.isfinite(seen.exit_s).all()
    assert seen.plan_error_m.max() <= 0.015
    assert outcome.collisions == 0
