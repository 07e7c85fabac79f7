"""Breakdown flows: bisection, what it may not do, and the table and figure made of it."""

import math

import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

import coramp
from coramp.report.capacity_figure import capacity_figure
from coramp.runs.running import make_spec
from coramp.studies.breakdown import Bisection, bisections, broke_down
from coramp.studies.capacity_layout import breakdowns, capacity_tables
from coramp.studies.definition import Search, count_runs, load_study
from tests.study import apart_from_time, overridden, run_row, runs_of, written

SEARCH = Search(
    strategies=["mainline-priority"],
    ramp_veh_h=[500.0],
    mainline_from_veh_h=1000.0,
    mainline_to_veh_h=2000.0,
    resolution_veh_h=100.0,
)

SMALL = """
name = "small capacity"
scenario = "paper"
layout = "capacity"
seeds = 2
horizon_s = 60.0

[[searches]]
strategies = ["mainline-priority", "uncontrolled"]
engine = "exact"
ramp_veh_h = [1500.0]
mainline_from_veh_h = 1200.0
mainline_to_veh_h = 4800.0
resolution_veh_h = 600.0
set = { "safety.time_gap_s" = [1.0] }
"""


def searched(breaks_from_veh_h):
    """Walks one search against a made-up truth; returns the flows that it asked for."""
    bisection = Bisection(SEARCH, make_spec("paper"))
    results, asked = {}, []
    while (spec := bisection.next_run(lambda s: results.get(s.run_id))) is not None:
        flow = spec.scenario.mainline.flow_veh_h
        delay = 9.0 if flow >= breaks_from_veh_h else 0.2
        results[spec.run_id] = run_row(mainline=flow, mainline_delay_s=delay, ramp_delay_s=0.0)
        asked.append(flow)
    return asked


@given(st.floats(900.0, 2200.0))
def test_the_search_ends_with_neighbours_on_both_sides_of_the_breakdown(truth):
    asked = searched(truth)
    assert len(asked) == len(set(asked)) <= 4
    broken = [flow for flow in asked if flow >= truth]
    good = [flow for flow in asked if flow < truth]
    if broken and good:
        assert min(broken) - max(good) == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("truth", "asked"),
    [(500.0, [1500.0, 1200.0, 1000.0]), (3000.0, [1500.0, 1800.0, 1900.0, 2000.0])],
)
def test_an_end_of_the_range_is_run_only_where_nothing_else_tells(truth, asked):
    assert searched(truth) == asked


def test_a_failed_run_ends_its_search():
    bisection = Bisection(SEARCH, make_spec("paper"))
    failed = {**run_row(), "status": "failed"}
    assert bisection.next_run(lambda spec: failed) is None


@pytest.mark.parametrize(
    ("figures", "broken"),
    [
        ({"mainline_delay_s": 5.0, "ramp_delay_s": 0.1}, False),
        ({"mainline_delay_s": 5.1, "ramp_delay_s": 0.1}, True),
        ({"mainline_delay_s": None, "ramp_delay_s": 6.0}, True),
        ({"mainline_delay_s": 0.1, "ramp_delay_s": 0.1, "unserved": 1}, True),
    ],
)
def test_breaking_down_is_five_seconds_or_anyone_left(figures, broken):
    assert broke_down(run_row(**figures)) is broken


def rows(seed, broken_from, ramp=500.0):
    return [
        run_row(mainline=flow, ramp=ramp, seed=seed, mainline_delay_s=delay, ramp_delay_s=0.0)
        for flow in (1000.0, 1500.0, 1600.0, 2000.0)
        for delay in [9.0 if flow >= broken_from else 0.1]
    ]


def test_the_table_has_means_and_says_what_lies_outside():
    runs = runs_of(*rows(1, 1500.0), *rows(2, 1600.0), *rows(3, 9999.0), *rows(1, 0.0, ramp=800.0))
    inside, below = breakdowns(runs)
    assert inside.flows == (1500.0, 1600.0)
    assert (inside.above, inside.below) == (1, 0)
    assert inside.estimate.mean == 1550.0
    # t of 0.975 with one degree of freedom is 12.7062, the standard error 50
    assert inside.estimate.half_width == pytest.approx(635.31, abs=0.01)
    assert (below.flows, below.below) == ((), 1)
    table = capacity_tables(runs)[0]
    assert table.rows == (
        (
            "mainline-priority, Eq. 1",
            "-",
            "1550 ± 635; above 2000 (1 of 3 seeds)",
            "at or below 1000",
        ),
    )


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        (None, "mainline-priority, Eq. 1"),
        ("safety.time_gap_s=0.6", "mainline-priority, 0.6 s"),
        ("safety.standstill_gap_m=2.5 safety.time_gap_s=1.0", "mainline-priority, 1.0 s, 2.5 m"),
        ("mainline.end_m=500.0", "mainline-priority, mainline.end_m=500.0"),
    ],
)
def test_combinations_are_named_by_their_gaps(overrides, name):
    given = overridden({"lane_limit_veh_h": 2604.9}, overrides)
    runs = runs_of(*({**row, **given} for row in rows(1, 1500.0)))
    table = capacity_tables(runs)[0]
    assert table.rows == ((name, "2605", "1500"),)


def test_the_figure_has_a_line_for_each_combination():
    runs = runs_of(*rows(1, 1500.0), *rows(1, 9999.0, ramp=800.0))
    figure = capacity_figure(runs)
    (axes,) = figure.axes
    (line,) = [c for c in axes.containers if c.get_label() == "mainline priority, Eq. 1"]
    assert line[0].get_xydata()[0].tolist() == [500.0, 1500.0]
    assert math.isnan(line[0].get_xydata()[1, 1])  # a limit of the search is no result
    limits = [drawn for drawn in axes.lines if drawn.get_gid() == "search limit above"]
    assert [drawn.get_xydata().tolist() for drawn in limits] == [[[800.0, 2000.0]]]


def test_a_small_capacity_study_runs_and_goes_on(tmp_path):
    definition, folder = written(tmp_path, SMALL), tmp_path / "o"
    whole = coramp.study(definition, jobs=2, out=folder)
    assert whole.failed.is_empty()
    assert (folder / "capacity.png").stat().st_size > 10_000
    engines = whole.runs.group_by("strategy").agg(pl.col("engine").unique()).sort("strategy")
    assert engines["engine"].to_list() == [["exact"], ["sumo"]]
    for found in breakdowns(whole.runs):
        assert len(found.flows) + found.above + found.below == 2
        assert all(1200.0 < flow <= 4800.0 for flow in found.flows)
    ran = []
    again = coramp.study(definition, jobs=2, out=folder, progress=lambda s: ran.append(s.last))
    assert [part for part in ran if part is not None] == []
    assert again.runs.equals(whole.runs)
    (folder / "parts" / f"{whole.runs['run_id'][0]}.json").unlink()
    mended = coramp.study(definition, jobs=2, out=folder)
    assert apart_from_time(mended.runs).equals(apart_from_time(whole.runs))


def test_what_cannot_be_searched_is_told(tmp_path):
    text = SMALL.replace("mainline_to_veh_h = 4800.0", "mainline_to_veh_h = 7000.0")
    with pytest.raises(coramp.CorampError, match="7000 cannot arrive with headways"):
        coramp.study(written(tmp_path, text), out=tmp_path / "o")
    text = SMALL.replace("mainline_to_veh_h = 4800.0", "mainline_to_veh_h = 900.0")
    with pytest.raises(coramp.CorampError, match="mainline_to_veh_h: 900 is not above"):
        coramp.study(written(tmp_path, text), out=tmp_path / "o")


def test_the_built_in_study_is_as_large_as_it_says():
    study = load_study("capacity")
    # three strategies at eight gaps, six populations of drivers, three ramp flows, three seeds
    assert len(bisections(study, 3, "capacity")) == (3 * 8 + 6) * 3 * 3
    most = sum(
        9 * len(search.strategies) * len(search.drivers) * math.ceil(math.log2(search.steps + 2))
        for search in study.searches
    )
    assert count_runs(study, 3) == most
