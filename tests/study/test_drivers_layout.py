"""The table of the study drivers, by hand, and what the study asks for."""

import polars as pl
import pytest

from coramp.records.schemas import RUNS
from coramp.runs.running import failed_row, make_spec
from coramp.studies.definition import expand, load_study
from coramp.studies.drivers_layout import drivers_tables
from coramp.studies.overrides import overrides_of, setting_of
from tests.study import run_row, runs_of

LONG = "mainline.start_m=-1500.0 ramp.start_m=-800.0"


def row(drivers, seed, before, after, overrides=LONG, **more):
    return run_row(
        "uncontrolled",
        1500.0,
        300.0,
        seed=seed,
        drivers=drivers,
        overrides=overrides,
        breakdown_time_s=None if after is None else 1800.0,
        prebreakdown_flow_veh_h=before,
        discharge_flow_veh_h=after,
        **more,
    )


def test_flows_and_drops_by_hand():
    runs = runs_of(
        row("credible", 1, 2000.0, 1800.0),
        row("credible", 2, 2100.0, 1995.0, collisions=2),
        row("credible", 3, None, None),
        row("credible", 4, None, 1900.0),
        row("fair", 1, None, None),
        row("fair", 1, 2500.0, 2600.0, overrides=None),
    )
    table, roads = drivers_tables(runs)
    assert [r[:3] for r in table.rows] == [
        ("1500", "credible", "3 of 4"),
        ("1500", "fair", "0 of 1"),
        ("400", "fair", "1 of 1"),
    ]
    credible = table.rows[0]
    assert credible[3] == "2050 ± 635"  # t of one degree of freedom, 12.706, times 50
    assert credible[4].startswith("1898 ± ")
    assert credible[5].startswith("7.5 ± ")
    assert credible[6:] == ("5.0 to 10.0", "2")
    assert table.rows[1][3:7] == ("-", "-", "-", "-")
    assert table.rows[2][3:7] == ("2500", "2600", "-4.0", "-4.0 to -4.0")
    assert any("1907.09606" in cell for r in roads.rows for cell in r)


def test_no_runs_are_no_tables():
    assert drivers_tables(pl.DataFrame(schema=RUNS)) == []


def test_overrides_are_read_back_with_their_values():
    overrides = {
        "drivers.credible.tau_s": [0.9, 1.2],
        "drivers.fair.integrator": "ballistic",
        "ramp.start_m": -800.0,
    }
    spec = make_spec("paper", "uncontrolled", overrides=overrides)
    run = failed_row(spec, "", 0.0)
    assert overrides_of(run) == overrides
    assert setting_of(run, "ramp.start_m") == -800.0
    assert setting_of(run, "mainline.start_m") == -400.0
    assert setting_of(run, "mainline.nothing") is None
    assert overrides_of({"settings": None}) == {}


def test_the_study_raises_the_ramps_flow_by_the_same_in_each_hour():
    specs = expand(load_study("drivers"), 1)
    assert {s.strategy for s in specs} == {"uncontrolled"}
    for spec in specs:
        ramp, hours = spec.scenario.ramp, spec.scenario.simulation.horizon_s / 3600.0
        assert (ramp.flow_to_veh_h - ramp.flow_veh_h) / hours == pytest.approx(800.0)
    own = {s.drivers for s in specs if s.scenario.mainline.start_m == -400.0}
    assert own == {"credible", "credible-uniform", "fair"}
    assert {s.drivers for s in specs if s.scenario.mainline.start_m == -1500.0} == own | {
        "automated-0.6",
        "automated-0.8",
        "automated-1.0",
    }
