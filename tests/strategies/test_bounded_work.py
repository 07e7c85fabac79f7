"""What a decision may cost, however many vehicles there are."""

import pytest

from coramp.runs.running import execute, make_spec
from coramp.strategies import sequence
from coramp.strategies.least_effort_planner import LeastEffort


@pytest.mark.parametrize("strategy", ["game", "fifo-optimal-control"])
def test_a_crowd_does_not_make_a_decision_try_every_gap(monkeypatch, strategy):
    tried, decisions = [], [0]
    plan, crossings = LeastEffort.plan, sequence.crossings

    def counted(self, fleet, situation, gap, rules):
        tried.append((decisions[0], len(situation.order)))
        return plan(self, fleet, situation, gap, rules)

    def numbered(*arguments):
        decisions[0] += 1
        return crossings(*arguments)

    monkeypatch.setattr(LeastEffort, "plan", counted)
    monkeypatch.setattr(sequence, "crossings", numbered)
    crowd = {
        "mainline.start_m": -3000.0,
        "ramp.start_m": -1500.0,
        "safety.time_gap_s": 1.0,
        "mainline.min_headway_s": 0.5,
        "ramp.min_headway_s": 0.8,
        "simulation.drain_s": 120.0,
    }
    execute(
        make_spec(
            "paper",
            strategy,
            engine="exact",
            mainline_veh_h=5000,
            ramp_veh_h=3000,
            horizon_s=60,
            overrides=crowd,
        )
    )
    of_decision = [number for number, _ in tried]
    assert max(vehicles for _, vehicles in tried) > 50
    assert max(map(of_decision.count, set(of_decision))) <= 24
