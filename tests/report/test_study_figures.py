"""Figures of studies, from rows made by hand."""

import math

import polars as pl
import pytest

from coramp.report.capacity_figure import capacity_figure
from coramp.report.flow_figures import delay_figure, flows_of, gain_figure, rung_figure
from coramp.report.sensitivity_figure import sensitivity_figure, settings_of
from coramp.report.style import COOPERATIVE, FREE_MARKERS, METERED, UNCONTROLLED, look_of
from coramp.strategies.registry import OURS, origin_of, strategies
from tests.study import overridden, run_row, runs_of

FLOWS = [(800.0, 200.0), (1800.0, 500.0)]
T_2 = 4.302652729911275
"""Student's t for 95 % and three seeds."""


def delays(strategy, flows, mainline, ramp, drivers=None, **rest):
    return run_row(
        strategy, *flows, drivers=drivers, mainline_delay_s=mainline, ramp_delay_s=ramp, **rest
    )


@pytest.fixture(scope="module")
def runs():
    rows = []
    for seed, more in ((1, -0.1), (2, 0.0), (3, 0.1)):
        for flows in FLOWS:
            rows += [
                delays(
                    "mainline-priority",
                    flows,
                    0.5 + more,
                    0.2,
                    seed=seed,
                    rung_free=6,
                    rung_reach=3,
                    rung_delay=1,
                    rung_hold=2,
                ),
                delays("ramp-priority", flows, 1.0, 0.1, seed=seed, rung_free=4, rung_create=4),
                delays("uncontrolled", flows, 10.0, 8.0, drivers="paper", seed=seed),
                delays("uncontrolled", flows, 2.0, 0.05, drivers="fair", seed=seed),
            ]
    rows.append(delays("uncontrolled", (800.0, 0.0), 1.0, None, drivers="fair"))
    return runs_of(*rows)


def errorbars(axes):
    """Returns each labelled line's heights and the ends of its error bars."""
    found = {}
    for container in axes.containers:
        line, _, (bars,) = container.lines
        ends = [tuple(segment[:, 1]) for segment in bars.get_segments()]
        found[container.get_label()] = (list(line.get_ydata()), ends)
    return found


def test_flows_are_those_of_cooperative_runs(runs):
    assert flows_of(runs) == [(800, 200), (1800, 500)]


def test_delays_are_means_with_intervals_for_each_strategy_and_population(runs):
    mainline, ramp = delay_figure(runs).axes
    drawn = errorbars(mainline)
    assert list(drawn) == [
        "mainline priority",
        "ramp priority",
        "no control, paper's drivers",
        "no control, fair drivers",
    ]
    heights, ends = drawn["mainline priority"]
    half_s = T_2 * 0.1 / 3**0.5
    assert heights == pytest.approx([0.5, 0.5])
    assert ends[0] == pytest.approx((0.5 - half_s, 0.5 + half_s))
    assert drawn["no control, paper's drivers"][0] == [10.0, 10.0]
    assert errorbars(ramp)["ramp priority"][0] == pytest.approx([0.1, 0.1])
    assert mainline.get_ylabel() == "mean delay (s)"
    assert [t.get_text() for t in ramp.get_xticklabels()] == ["800 + 200", "1800 + 500"]


def test_strategies_differ_by_more_than_colour():
    looks = [
        look_of("mainline-priority"),
        look_of("ramp-priority"),
        look_of("uncontrolled", "paper"),
        look_of("uncontrolled", "fair"),
    ]
    for part in ("colour", "marker", "line", "label"):
        assert len({getattr(look, part) for look in looks}) == 4
    assert look_of("mine").label == "mine"
    assert look_of("mine") == look_of("mine")
    assert look_of("uncontrolled", "sleepy").label == "uncontrolled (sleepy)"


def test_every_strategy_of_our_own_has_a_look():
    ours = {n: found for n, found in strategies().items() if origin_of(n) == OURS}
    expected = {n for n, found in ours.items() if found.cooperative}
    assert set(COOPERATIVE) == expected
    assert set(METERED) == set(ours) - expected - {"uncontrolled"}


def test_no_two_known_strategies_share_colour_and_marker():
    looks = [*COOPERATIVE.values(), *METERED.values(), *UNCONTROLLED.values()]
    drawn = [(look.colour, look.marker) for look in looks]
    assert len(set(drawn)) == len(drawn)
    assert {marker for _, marker in drawn}.isdisjoint(FREE_MARKERS)


def test_metered_drivers_are_named_with_their_population_and_look_unlike_all_others():
    fair, credible = (look_of("alinea", drivers) for drivers in ("fair", "credible"))
    assert (fair.label, credible.label) == ("ALINEA, fair drivers", "ALINEA, credible drivers")
    assert fair.colour != credible.colour
    known = [*COOPERATIVE.values(), *METERED.values(), *UNCONTROLLED.values()]
    assert fair.marker not in {look.marker for look in known}


def test_gains_stand_beside_each_other_and_beside_the_papers(runs):
    axes = gain_figure(runs).axes
    by_title = {a.get_title(): a for a in axes}
    mainline = by_title["mainline priority, mainline"]
    against_paper, against_fair = ([bar.get_height() for bar in c] for c in mainline.containers)
    assert against_paper == pytest.approx([95.0, 95.0])  # 1 - 0.5 / 10
    assert against_fair == pytest.approx([75.0, 75.0])  # 1 - 0.5 / 2
    (printed,) = mainline.get_lines()
    assert printed.get_ydata() == pytest.approx(
        [100.0 * (1.0 - 0.23 / 4.44), 100.0 * (1.0 - 0.68 / 26.98)]
    )
    (printed,) = by_title["ramp priority, ramp"].get_lines()
    assert printed.get_ydata() == pytest.approx(
        [100.0 * (1.0 - 0.46 / 7.35), 100.0 * (1.0 - 0.85 / 20.42)]
    )
    assert axes[0].get_ylabel() == "delay saved (%)"


def test_there_is_no_gain_over_a_baseline_that_loses_nothing(runs):
    ramp = next(a for a in gain_figure(runs).axes if a.get_title() == "mainline priority, ramp")
    against_paper, against_fair = ([bar.get_height() for bar in c] for c in ramp.containers)
    assert against_paper == pytest.approx([97.5, 97.5])
    assert against_fair == [0.0, 0.0]  # 0.05 s is below the least baseline


def test_rungs_are_shares_of_all_merges_on_top_of_each_other(runs):
    mainline, ramp = rung_figure(runs).axes
    bars = {
        c.get_label()[:5]: [(b.get_y(), b.get_height()) for b in c] for c in mainline.containers
    }
    assert bars["free:"][0] == pytest.approx((0.0, 60.0))
    assert bars["reach"][0] == pytest.approx((60.0, 30.0))
    assert bars["delay"][0] == pytest.approx((90.0, 10.0))
    assert "creat" not in bars  # a rung that gave no merge is neither drawn nor in the legend
    assert [t.get_text() for t in mainline.texts] == ["60 %"] * 2 + ["30 %"] * 2 + ["10 %"] * 2
    (held,) = mainline.get_lines()
    assert held.get_ydata() == pytest.approx([20.0, 20.0])
    heights = {c.get_label()[:5]: c[1].get_height() for c in ramp.containers}
    assert heights == pytest.approx({"free:": 50.0, "creat": 50.0})
    assert ramp.get_lines()[:] == []
    assert ramp.get_title() == "ramp priority: no vehicle had to wait (hold)"
    assert mainline.get_ylabel() == "share of ramp vehicles (%)"


def setting(text, mainline, ramp=0.3, seed=1):
    row = delays("mainline-priority", (1800.0, 500.0), mainline, ramp, seed=seed)
    return {**overridden(row, text), "run_id": f"{text}{seed}"}


@pytest.fixture(scope="module")
def settings():
    return runs_of(
        setting(None, 0.1),
        setting("safety.time_gap_s=1.0", 40.0),
        setting("safety.time_gap_s=0.6", 3.0, seed=1),
        setting("safety.time_gap_s=0.6", 5.0, seed=2),
        setting("safety.positioning_error_m=0.5", 0.2),
    )


def test_settings_stand_in_order_with_the_scenarios_own_value(settings):
    assert settings_of(settings) == {
        "safety.positioning_error_m": [(0.02, None), (0.5, "safety.positioning_error_m=0.5")],
        "safety.time_gap_s": [
            (0.0, None),
            (0.6, "safety.time_gap_s=0.6"),
            (1.0, "safety.time_gap_s=1.0"),
        ],
    }


def test_sensitivity_has_a_column_a_setting_and_shows_everything(settings):
    axes = sensitivity_figure(settings).axes
    assert [a.get_xlabel() for a in axes] == ["", "", "positioning error L₁ (m)", "time gap (s)"]
    assert [a.get_ylabel() for a in axes[::2]] == ["mean mainline delay (s)", "mean ramp delay (s)"]
    heights, _ = errorbars(axes[1])["1800 + 500 veh/h"]
    assert heights == pytest.approx([0.1, 4.0, 40.0])
    low, high = axes[1].get_ylim()
    assert low == 0.0
    assert high > 40.0
    limits = [line.get_ydata()[0] for line in axes[1].get_lines() if len(line.get_xdata()) == 2]
    assert 5.0 in limits
    for diagram in axes:
        assert "5 s: broken down above" in [text.get_text() for text in diagram.texts]


def test_settings_that_change_nothing_share_a_diagram():
    runs = runs_of(
        setting(None, 0.1),
        setting("safety.time_gap_s=1.0", 40.0),
        setting("safety.positioning_error_m=0.5", 0.2),
        setting("safety.clock_error_s=0.01", 0.1),
    )
    axes = sensitivity_figure(runs).axes
    assert len(axes) == 4
    heights, ends = errorbars(axes[0])["1800 + 500 veh/h"]
    assert heights == pytest.approx([0.15, 0.1])  # the middle of each setting's delays
    assert ends[0] == pytest.approx((0.1, 0.2))
    words = [label.get_text() for label in axes[2].get_xticklabels()]
    assert words[0] == "positioning error L₁,\n0.02 to 0.5 m"
    assert axes[0].get_title() == "mainline: no delay changes by more than 0.5 s"
    assert axes[3].get_xlabel() == "time gap (s)"


def test_capacity_has_a_line_a_combination_in_the_strategys_colour():
    rows = []
    for text in (None, "safety.time_gap_s=1.0"):
        for flow, delay in ((1200.0, 0.1), (1400.0, 9.0 if text else 0.1), (1600.0, 9.0)):
            row = delays("mainline-priority", (flow, 500.0), delay, 0.1)
            rows.append(overridden(row, text))
    rows += [
        delays("uncontrolled", (flow, 500.0), delay, 0.1, drivers="fair")
        for flow, delay in ((1200.0, 0.1), (1600.0, 9.0))
    ]
    (axes,) = capacity_figure(runs_of(*rows)).axes
    drawn = {label: heights for label, (heights, _) in errorbars(axes).items()}
    assert drawn == {
        "mainline priority, Eq. 1": [1600.0],
        "mainline priority, 1.0 s": [1400.0],
        "no control, fair drivers": [1600.0],
    }
    colours = {c.get_label(): c.lines[0].get_color() for c in axes.containers}
    assert colours["mainline priority, Eq. 1"] == colours["mainline priority, 1.0 s"]
    assert colours["mainline priority, Eq. 1"] != colours["no control, fair drivers"]
    lines = [c.lines[0].get_linestyle() for c in axes.containers[:2]]
    assert lines[0] != lines[1]
    assert axes.get_xlabel() == "ramp flow (veh/h)"
    assert axes.get_ylabel() == "mainline flow at breakdown (veh/h)"


def test_limits_of_the_search_are_no_results():
    rows = [
        delays(
            "mainline-priority", (flow, ramp), 9.0 if (flow, ramp) == (1600.0, 500.0) else 0.1, 0.1
        )
        for ramp in (200.0, 500.0)
        for flow in (1200.0, 1600.0)
    ]
    rows += [delays("slots", (flow, 200.0), 0.1, 0.1) for flow in (1200.0, 1600.0)]
    figure = capacity_figure(runs_of(*rows))
    (axes,) = figure.axes
    (container,) = axes.containers
    heights = container.lines[0].get_ydata().tolist()
    assert heights == pytest.approx([math.nan, 1600.0], nan_ok=True)
    (limit,) = [line for line in axes.get_lines() if line.get_gid() == "search limit above"]
    assert limit.get_xydata().tolist() == [[200.0, 1600.0]]
    assert limit.get_markerfacecolor() == "none"
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "search ended here without breakdown: the flow is higher" in words
    assert figure.get_suptitle().endswith("not drawn: slots, Eq. 1")


def test_many_combinations_have_a_diagram_per_following_distance():
    rows = []
    for gap in ("0.6", "1.0", "1.4"):
        for strategy in ("mainline-priority", "slots", "game"):
            for flow, delay in ((1200.0, 0.1), (1600.0, 9.0)):
                row = delays(strategy, (flow, 500.0), delay, 0.1)
                rows.append(overridden(row, f"safety.time_gap_s={gap}"))
    drawn = [axes for axes in capacity_figure(runs_of(*rows)).axes if axes.axison]
    assert [axes.get_title() for axes in drawn] == ["at 0.6 s", "at 1.0 s", "at 1.4 s"]
    for axes in drawn:
        assert set(errorbars(axes)) == {"mainline priority", "slots", "game"}


def test_capacity_shows_what_the_lane_carries_where_it_lies_within_the_range():
    rows = []
    for text, limit in ((None, 14008.0), ("safety.time_gap_s=1.0", 2864.0)):
        for ramp in (200.0, 1000.0):
            for flow, delay in ((1200.0, 0.1), (3000.0, 9.0)):
                row = delays("mainline-priority", (flow, ramp), delay, 0.1)
                rows.append({**overridden(row, text), "lane_limit_veh_h": limit})
    (axes,) = capacity_figure(runs_of(*rows)).axes
    dotted = [line for line in axes.get_lines() if line.get_linestyle() == ":"]
    assert [line.get_xydata().tolist() for line in dotted] == [[[200.0, 2664.0], [1000.0, 1864.0]]]
    assert "lane: 2,864" in [text.get_text() for text in axes.texts]


def test_failed_runs_are_not_drawn_in_capacity(runs):
    failed = runs.head(1).with_columns(status=pl.lit("failed"))
    assert capacity_figure(failed).axes[0].containers == []
