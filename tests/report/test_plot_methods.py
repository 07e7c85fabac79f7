"""The figures that results have as methods, against their records."""

import math
from itertools import pairwise

import polars as pl
import pytest
from matplotlib.colors import to_hex

import coramp
from coramp import CorampError
from coramp.report.style import BLUE, GREY, VERMILION

STUDY = """
name = "tiny {layout}"
scenario = "paper"
layout = "{layout}"
seeds = 1
horizon_s = 30.0

[[runs]]
strategies = ["mainline-priority"]
engine = "exact"
flows_veh_h = [[1200.0, 500.0], [1800.0, 500.0]]
{settings}
"""
SETTINGS = 'set = { "safety.time_gap_s" = [0.0, 0.6] }'
CAPACITY = """
name = "tiny capacity"
scenario = "paper"
layout = "capacity"
seeds = 1
horizon_s = 30.0

[[searches]]
strategies = ["mainline-priority"]
engine = "exact"
mainline_from_veh_h = 1000.0
mainline_to_veh_h = 2000.0
resolution_veh_h = 1000.0
ramp_veh_h = [500.0]
"""


@pytest.fixture(scope="module")
def run():
    flows = {"mainline_veh_h": 2400, "ramp_veh_h": 900, "horizon_s": 150}
    return coramp.run("paper", engine="exact", overrides={"safety.time_gap_s": 0.6}, **flows)


@pytest.fixture(scope="module")
def uncontrolled():
    return coramp.run("paper", "uncontrolled", horizon_s=20)


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("studies"), {}
    texts = {name: STUDY.format(layout=name, settings="") for name in ("paper", "plain")}
    texts |= {"sensitivity": STUDY.format(layout="sensitivity", settings=SETTINGS)}
    for name, text in (texts | {"capacity": CAPACITY}).items():
        (folder / f"{name}.toml").write_text(text)
        found[name] = coramp.study(str(folder / f"{name}.toml"), jobs=1, out=folder / name)
    return found


def lines_of(axes):
    return {line.get_gid(): line for line in axes.get_lines()}


@pytest.mark.parametrize(
    ("window", "limits_s"),
    [((), (0.0, 120.0)), ((30.0,), (30.0, 150.0)), ((30.0, 60.0), (30.0, 60.0))],
)
def test_everyone_who_is_there_in_the_window_has_a_line(run, window, limits_s):
    (axes,) = run.plot_time_space(*window).axes
    from_s, until_s = limits_s
    assert axes.get_xlim() == limits_s
    there = run.vehicles.filter((pl.col("entry_s") < until_s) & (pl.col("exit_s") > from_s))
    lines = lines_of(axes)
    merges = lines.pop("merges")
    assert set(lines) == set(there["vehicle_id"])
    for row in there.iter_rows(named=True):
        times_s, stations_m = lines[row["vehicle_id"]].get_data()
        assert times_s[0] == pytest.approx(max(from_s, row["entry_s"]))
        assert times_s[-1] == pytest.approx(min(until_s, row["exit_s"]))
        assert all(later >= here for here, later in pairwise(stations_m))
        if row["entry_s"] >= from_s:
            assert stations_m[0] == pytest.approx(-400.0)
        if row["exit_s"] <= until_s:
            assert stations_m[-1] == pytest.approx(400.0, abs=1e-6)
    within = run.decisions.filter(pl.col("merge_time_s").is_between(from_s, until_s))
    assert list(merges.get_xdata()) == within["merge_time_s"].to_list()
    assert list(merges.get_ydata()) == within["merge_station_m"].to_list()


def test_ramp_moved_and_mainline_vehicles_are_told_apart(run):
    lines = lines_of(run.plot_time_space().axes[0])
    moved = set(run.decisions["adjusted_vehicle_ids"].explode().drop_nulls())
    assert moved
    for name, line in lines.items():
        stays = GREY if name not in moved else BLUE
        expected = stays if name.startswith("m0") else VERMILION
        assert to_hex(line.get_color()) == expected, name


@pytest.mark.parametrize("window", [(60.0, 60.0), (60.0, 30.0), (0.0, math.nan), (math.inf,)])
def test_an_empty_window_is_refused(run, window):
    with pytest.raises(CorampError, match=r"^until_s: .* is not after from_s; allowed is above"):
        run.plot_time_space(*window)


def test_ordinary_drivers_have_no_decisions_to_draw(uncontrolled):
    with pytest.raises(CorampError, match=r"^no vehicle was coordinated in this run; plot a coop"):
        uncontrolled.plot_decision("m00001")


def test_what_drivers_drove_is_drawn_as_well():
    flows = {"mainline_veh_h": 1200, "ramp_veh_h": 600, "horizon_s": 60}
    drivers = coramp.run("paper", "uncontrolled", **flows)
    (axes,) = drivers.plot_time_space(10.0, 90.0).axes
    lines = lines_of(axes)
    merges = lines.pop("merges")
    there = drivers.vehicles.filter((pl.col("entry_s") < 90.0) & (pl.col("exit_s") > 10.0))
    assert set(lines) == set(there["vehicle_id"])
    assert {to_hex(line.get_color()) for line in lines.values()} == {GREY, VERMILION}
    assert 0 < len(merges.get_xdata()) <= sum(name.startswith("r") for name in lines)
    assert all(-1.0 <= station_m <= 205.0 for station_m in merges.get_ydata())


def test_speeds_of_both_streams_are_drawn(run, uncontrolled):
    for result in (run, uncontrolled):
        for axes, stream in zip(result.plot_speeds().axes, ("mainline", "ramp"), strict=True):
            assert axes.get_ylabel() == f"{stream} speed (m/s)"
            faint = dict(zip(*axes.get_lines()[0].get_data(), strict=True))
            recorded = result.speeds.filter(stream=stream)
            for row in recorded.iter_rows(named=True):
                if row["time_s"] < axes.get_xlim()[1]:
                    assert faint[row["time_s"]] == row["mean_speed_mps"]


def test_the_decision_of_a_run_at_hand_is_drawn(run):
    merge = run.decisions.drop_nulls("merge_time_s").row(0, named=True)
    below = run.plot_decision(merge["vehicle_id"]).axes[1]
    assert lines_of(below)["merge"].get_xdata() == [merge["merge_time_s"]]
    with pytest.raises(CorampError, match=r"^there is no vehicle 'x'; allowed are "):
        run.plot_decision("x")


def test_a_plan_is_drawn_before_and_after():
    before, after = coramp.plan("example").plot_time_space().axes[:2]
    assert (before.get_title(), after.get_title()) == (
        "before the decision",
        "after the decision: mainline priority",
    )
    assert {"m4", "m5", "r1"} <= set(lines_of(after))


def test_figures_show_themselves_in_notebooks(run):
    assert run.plot_speeds()._repr_png_().startswith(b"\x89PNG\r\n")


PAPER = ("plot_gain", "plot_rungs")
LAYOUTS = {
    **dict.fromkeys(PAPER, "paper"),
    "plot_sensitivity": "sensitivity",
    "plot_capacity": "capacity",
}


@pytest.mark.parametrize(("method", "layout"), LAYOUTS.items())
def test_a_study_draws_the_figures_of_its_layout_alone(studies, method, layout):
    for name, study in studies.items():
        assert study.layout == name
        if name == layout:
            continue
        with pytest.raises(CorampError) as caught:
            getattr(study, method)()
        assert str(caught.value) == (
            f"{study.folder}: the study's layout is {name}; "
            f"this figure is of studies with the layout {layout}"
        )
    assert getattr(studies[layout], method)().axes[0].has_data()


def test_delays_drawn_are_those_of_the_runs(studies):
    runs = studies["paper"].runs.sort("mainline_veh_h")
    mainline, ramp = studies["paper"].plot_delay().axes
    for axes, column in ((mainline, "mainline_delay_s"), (ramp, "ramp_delay_s")):
        drawn = [c for c in axes.containers if c.get_label() == "mainline priority"]
        assert list(drawn[0].lines[0].get_ydata()) == runs[column].to_list()


def test_a_study_without_a_good_run_has_nothing_to_draw(studies):
    paper = studies["paper"]
    runs = paper.runs.with_columns(pl.lit("failed").alias("status"))
    failed = coramp.StudyResult(paper.folder, runs, paper.streams, paper.tables, "paper")
    with pytest.raises(CorampError, match="no run went well; there is nothing to plot"):
        failed.plot_delay()


def test_a_study_in_which_nothing_varies_has_no_sensitivity(studies):
    plain = studies["plain"]
    same = coramp.StudyResult(plain.folder, plain.runs, plain.streams, (), "sensitivity")
    with pytest.raises(CorampError, match="no setting varies alone; there is nothing to plot"):
        same.plot_sensitivity()
