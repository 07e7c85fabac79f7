"""Speeds over time and margins, from records made by hand."""

import math

import numpy as np
import polars as pl
import pytest

from coramp.records.run import RunRecords
from coramp.records.schemas import DECISIONS, SPEEDS
from coramp.report.road_figure import road_figure
from coramp.report.run_figures import margin_distribution, margin_figure, speed_figure
from coramp.runs.running import make_spec, run_content
from coramp.scenarios.loading import load_scenario


def drawn(strategy="mainline-priority", drivers=None, ramp=200.0, seed=1, mps=20.0, margins=()):
    times_s = [0.0, 1.0, 3.0, 7.0]
    speeds = pl.DataFrame(
        {
            "stream": ["mainline"] * 4 + ["ramp"] * 4,
            "time_s": times_s * 2,
            "mean_speed_mps": [mps, mps - 2.0, mps - 1.0, 1.0] + [9.0] * 4,
            "vehicles": [1, 3, 1, 1] * 2,
        },
        schema=SPEEDS,
    )
    rows = [{**dict.fromkeys(DECISIONS), "min_margin_m": margin_m} for margin_m in margins]
    decisions = None if drivers else pl.DataFrame(rows, schema=DECISIONS)
    spec = make_spec(
        "paper",
        strategy,
        engine="sumo",
        drivers=drivers,
        mainline_veh_h=1800.0,
        ramp_veh_h=ramp,
        seed=seed,
        horizon_s=5.0,
    )
    return RunRecords(run_content(spec, {}), {}, pl.DataFrame(), speeds, decisions=decisions)


def test_speeds_are_drawn_bin_by_bin_with_a_gap_where_nobody_was():
    (axes,) = speed_figure([drawn(), drawn(seed=2, mps=12.0)], "mainline").axes
    faint, bold = axes.get_lines()  # those of the first seed alone
    assert list(faint.get_xdata()) == [0.0, 1.0, 2.0, 3.0, 4.0]  # up to the horizon
    np.testing.assert_array_equal(faint.get_ydata(), [20.0, 18.0, math.nan, 19.0, math.nan])
    assert bold.get_ydata() == pytest.approx([(20.0 + 3 * 18.0 + 19.0) / 5.0] * 5)
    assert axes.get_ylabel() == "mainline speed (m/s)"
    assert axes.get_xlabel() == "time (s)"


def test_there_is_a_diagram_a_ramp_flow_and_a_line_a_strategy():
    runs = [
        drawn(strategy, drivers, ramp)
        for ramp in (500.0, 200.0)
        for strategy, drivers in (("uncontrolled", "paper"), ("mainline-priority", None))
    ]
    axes = speed_figure(runs, "ramp").axes
    assert [a.get_title() for a in axes] == ["1800 + 200 veh/h", "1800 + 500 veh/h"]
    for diagram in axes:
        _, labels = diagram.get_legend_handles_labels()
        assert labels == ["no control, paper's drivers", "mainline priority"]
        assert set(diagram.get_lines()[1].get_ydata()) == {9.0}


def test_margins_of_all_seeds_are_counted_and_those_who_are_alone_are_beyond():
    runs = [drawn(margins=(3.0, None, 0.1)), drawn(seed=2, margins=(math.inf, 1.0))]
    margins_m, shares = margin_distribution(runs)
    assert margins_m.tolist() == [0.1, 1.0, 3.0]
    assert shares.tolist() == [0.25, 0.5, 0.75]


def test_the_margin_figure_draws_shares_and_what_the_checker_asks():
    runs = [
        drawn(margins=(3.0, 0.2)),
        drawn("ramp-priority", margins=(5.0,)),
        drawn("uncontrolled", "paper"),
    ]
    (axes,) = margin_figure(runs, 0.15).axes
    assert "0.15 m, the least that" in axes.texts[0].get_text()
    mainline, ramp, asked = axes.get_lines()
    assert mainline.get_xdata().tolist() == [0.2, 3.0]
    assert mainline.get_ydata().tolist() == [50.0, 100.0]
    assert (ramp.get_xdata().tolist(), ramp.get_ydata().tolist()) == ([5.0], [100.0])
    assert asked.get_xdata() == [0.15, 0.15]
    assert axes.get_xlabel() == "margin over the safe distance (m)"
    assert axes.get_ylabel() == "decisions with at most this margin (%)"


def test_strategies_whose_margins_coincide_are_one_line_that_says_so():
    same = [drawn(margins=(0.1, 3.0)), drawn("ramp-priority", margins=(0.10002, 3.0))]
    (axes,) = margin_figure([*same, drawn("slots", margins=(9.0,))], 0.1).axes
    _, labels = axes.get_legend_handles_labels()
    assert labels == [
        "1800 + 200 veh/h: mainline priority and ramp priority coincide",
        "1800 + 200 veh/h: slots",
    ]


def test_the_road_is_drawn_as_long_as_the_scenario_says():
    whole, _ = road_figure(load_scenario("paper")).axes
    lanes = {line.get_gid(): np.column_stack(line.get_data()) for line in whole.get_lines()}
    lengths_m = {name: np.hypot(*np.diff(points, axis=0).T).sum() for name, points in lanes.items()}
    assert lengths_m == pytest.approx(
        {"mainline_0": 400, "ramp_0": 400, "merge_0": 200, "merge_1": 200, "downstream_0": 200},
        abs=0.05,
    )
    ramp = lanes["ramp_0"]
    slope = (ramp[1, 1] - ramp[0, 1]) / (ramp[1, 0] - ramp[0, 0])
    assert slope == pytest.approx(math.tan(math.radians(30.0)), abs=1e-3)
    assert whole.get_aspect() == 1.0
    assert (whole.get_xlabel(), whole.get_ylabel()) == ("station (m)", "across (m)")
