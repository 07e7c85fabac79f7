"""Strategies that look at drivers, or command them: reports are messages, commands are refused."""

import numpy as np
import polars as pl
import pytest

import coramp
from coramp.audit.audit import audit
from coramp.strategies.base import Decision, FollowTrajectory, SetRampSignal
from coramp.vehicles.merge_state import NOT_PLANNED_S

SHORT = {"mainline_veh_h": 1500.0, "ramp_veh_h": 500.0, "seed": 3, "horizon_s": 40.0}
SEEN = []


class Looking:
    """Green while fewer vehicles than ten are upstream of the nose."""

    name, summary, cooperative = "looking-test", "looks at drivers", False
    metered, period_s = True, 0.7

    def decide(self, view, memory):
        """Returns the colour, where it changes."""
        reports = view.drivers.reports
        SEEN.append((view.time_s, view.drivers.rows, reports))
        green = bool((reports.station_m < 0.0).sum() + 0.01 * reports.speed_mps.sum() % 1.0 < 10.0)
        changed = green != (memory is None or memory)
        return Decision((SetRampSignal(green),) if changed else (), (), green)


class Commanding:
    """Commands every driver to stand."""

    name, summary, cooperative = "commanding-test", "commands drivers", False
    period_s = 2.0

    def decide(self, view, memory):
        """Returns a stop for the first driver, if there is one."""
        reports, rows = view.drivers.reports, view.drivers.rows.tolist()
        if not rows:
            return Decision((), (), memory)
        pieces = np.array([[view.time_s, reports.station_m[0], 0.0, 0.0]])
        return Decision((FollowTrajectory(rows[0], pieces, NOT_PLANNED_S),), (), memory)


@pytest.fixture(scope="module", autouse=True)
def registered():
    coramp.register(Looking, replace=True)
    coramp.register(Commanding, replace=True)


@pytest.fixture(scope="module")
def looking(tmp_path_factory):
    folder = tmp_path_factory.mktemp("looking") / "r"
    SEEN.clear()
    return coramp.run("paper", "looking-test", **SHORT, out=folder, keep_messages=True), folder


def test_reports_are_where_the_vehicles_were(looking):
    run, _ = looking
    entries = run.vehicles.filter(pl.col("entry_s").is_not_null())
    assert sum(len(rows) for _, rows, _ in SEEN) > 500
    for time_s, rows, reports in SEEN:
        assert np.allclose(reports.time_s, time_s - 0.1)
        there = (entries["entry_s"] < time_s - 0.15) & (entries["exit_s"] > time_s)
        assert abs(len(rows) - there.sum()) <= 1  # SUMO takes a vehicle off at the end of its step


def test_what_was_decided_on_reports_can_be_replayed(looking):
    _, folder = looking
    result = audit(folder)
    assert [check.how for check in result.checks if check.findings] == []
    signals = next(check for check in result.checks if check.claim == "decisions")
    assert int(signals.how.split()[0]) >= 2


def test_commands_to_drivers_are_refused_and_counted():
    told = []
    run = coramp.run("paper", "commanding-test", **SHORT, notice=told.append)
    free = coramp.run("paper", "uncontrolled", **SHORT)
    assert run.summary["interventions"] > 10
    assert free.summary["interventions"] is None
    assert run.vehicles["exit_s"].equals(free.vehicles["exit_s"])
    assert f"{run.summary['interventions']} commands were refused: drivers take none" in told[-1]
