"""Tables of the studies field and baseline, by hand."""

import math

import polars as pl
import pytest

from coramp.records.schemas import RUNS
from coramp.report.baseline_figure import KINDS, POPULATIONS, baseline_figure
from coramp.report.field_figure import field_figure
from coramp.report.front_figure import front_figure
from coramp.strategies.registry import strategies
from coramp.studies.baseline_layout import baseline_tables
from coramp.studies.baseline_runs import settings_of
from coramp.studies.definition import count_runs, expand, load_study
from coramp.studies.field_layout import (
    METRICS,
    Metric,
    field_tables,
    mean_of,
    paired_difference,
    pareto_front,
    ranks,
    with_derived,
)
from coramp.studies.statistics import estimate
from tests.study import overridden, run_row, runs_of

FLOWS = [(800.0, 200.0), (2200.0, 700.0)]


def field_row(strategy, flow, seed, mainline_s, ramp_s, fuel_l, **more):
    return run_row(
        strategy,
        *flow,
        seed=seed,
        drivers="fair" if strategy in ("uncontrolled", "alinea") else None,
        vehicles_mainline=300,
        vehicles_ramp=100,
        mainline_delay_s=mainline_s,
        ramp_delay_s=ramp_s,
        fuel_l=fuel_l,
        **more,
    )


@pytest.fixture
def field():
    rows = []
    for seed in (1, 2):
        for flow in FLOWS:
            rows += [
                field_row("uncontrolled", flow, seed, 4.0 + seed, 2.0, 20.0),
                field_row("ocbf", flow, seed, 1.0, 0.0, 18.0, interventions=5),
                field_row("game", flow, seed, 1.0 + seed, 1.0, 16.0),
                field_row("alinea", flow, seed, 3.0, 90.0, 21.0),
            ]
    return runs_of(*rows)


def test_the_delay_of_all_weighs_every_vehicle(field):
    runs = with_derived(field)
    # seeds 1 and 2: (3 x 5 + 2) / 4 and (3 x 6 + 2) / 4
    assert mean_of(runs, "uncontrolled", "delay_s").mean == pytest.approx(0.5 * (17 / 4 + 20 / 4))
    assert mean_of(runs, "game", "fuel_ml").mean == pytest.approx(40.0)


def test_differences_are_paired_by_seed(field):
    runs = with_derived(field)
    found = paired_difference(runs, "game", "delay_s")
    # (3 (1 + seed) + 1 - 3 (4 + seed) - 2) / 4: the same for both seeds, so that it is sure
    assert found.mean == pytest.approx(-2.5)
    assert found.half_width == pytest.approx(0.0, abs=1e-9)
    spread = paired_difference(runs, "ocbf", "delay_s")
    assert spread.half_width == pytest.approx(12.706 * 0.75 / 2.0, rel=1e-3)


def test_who_has_no_value_for_a_seed_is_left_out(field):
    broken = field.filter(~((pl.col("strategy") == "game") & (pl.col("seed") == 2)))
    assert mean_of(with_derived(broken), "game", "delay_s").values == 1


def test_the_front_by_hand():
    points = [("a", 1.0, 5.0), ("b", 2.0, 2.0), ("c", 2.0, 3.0), ("d", 5.0, 1.0), ("e", 5.0, 5.0)]
    assert pareto_front(points) == ["a", "b", "d"]
    assert pareto_front([("a", 1.0, 1.0), ("b", 1.0, 1.0)]) == ["a", "b"]


def test_ranks_by_hand():
    found = {name: estimate([value]) for name, value in (("a", 2.0), ("b", 1.0), ("c", 1.001))}
    found["d"] = estimate([])
    assert ranks(Metric(""), found) == {"a": 3, "b": 1, "c": 1}
    assert ranks(Metric("", True), found) == {"a": 1, "b": 2, "c": 2}


def test_the_tables_of_the_field(field):
    tables = {table.title: table for table in field_tables(field)}
    assert [title.split(",")[0] for title in tables] == [
        "Delay by flow (s)",
        "Delay less that of drivers",
        *["All metrics", "Less uncontrolled (fair drivers)", "Ranks"] * 2,
    ]
    by_flow = tables["Delay by flow (s)"]
    assert by_flow.columns == ("strategy", "800 + 200", "2200 + 700")
    assert [row[0] for row in by_flow.rows] == ["uncontrolled", "alinea", "game", "ocbf"]
    for table in tables.values():
        assert all(len(row) == len(table.columns) for row in table.rows)
    ranked = {row[0]: row for row in tables["Ranks, flows beyond capacity"].rows}
    assert [name for name, row in ranked.items() if row[-1] == "yes"] == ["game", "ocbf"]
    interventions = 1 + [m.column for m in METRICS].index("interventions")
    all_metrics = {row[0]: row for row in tables["All metrics, flows beyond capacity"].rows}
    assert all_metrics["ocbf"][interventions] == "5.0 ± 0.0"


def test_the_field_has_every_strategy_at_twelve_flows():
    study = load_study("field")
    specs = expand(study, 1)
    in_the_field = set(strategies()) - {"mixed-slots", "hero"}
    # mixed-slots is slots among automated vehicles alone; hero is for several ramps
    assert {spec.strategy for spec in specs} == in_the_field
    assert count_runs(study, 10) == 10 * 12 * len(in_the_field)
    assert len({(s.scenario.mainline.flow_veh_h, s.scenario.ramp.flow_veh_h) for s in specs}) == 12


def test_the_figure_of_the_field_draws_what_there_is(field):
    figure = field_figure(field)
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert labels == ["no control, fair drivers", "ALINEA", "game", "OCBF"]
    xs = [float(c.lines[0].get_xdata()[0]) for c in figure.axes[1].containers]
    assert xs == pytest.approx([50.0, 52.5, 40.0, 45.0] * 2)


def test_the_figure_of_the_front_joins_who_is_on_it(field):
    figure = front_figure(field)
    assert [axes.get_title() for axes in figure.axes] == [
        "the paper's nine flows",
        "flows beyond capacity",
    ]
    joined = figure.axes[0].lines[0]
    # ocbf: 0.75 s and 45 ml; game: (2 + 3) / 2 x 3/4 + 1/4 s and 40 ml
    assert joined.get_xdata().tolist() == pytest.approx([0.75, 2.125])
    assert joined.get_ydata().tolist() == pytest.approx([45.0, 40.0])


def test_strategies_that_coincide_are_told_in_the_front(field):
    as_game = field.filter(strategy="game").with_columns(strategy=pl.lit("slots"))
    axes = front_figure(pl.concat([field, as_game])).axes[0]
    told = [text.get_text() for text in axes.texts]
    assert "2 coincide:\ngame*\nslots*" in told or "2 coincide:\nslots*\ngame*" in told
    assert "OCBF*" in told
    assert len([line for line in axes.get_lines() if line.get_gid() == "ring"]) == 1


def test_a_delay_below_none_is_drawn_too(field):
    early = field.with_columns(
        ramp_delay_s=pl.when(pl.col("strategy") == "ocbf")
        .then(-9.0)
        .otherwise(pl.col("ramp_delay_s"))
    )
    assert field_figure(early).axes[0].get_xlim()[0] <= -1.5


def baseline_rows():
    flow = (1800.0, 500.0)
    made = [
        ("mainline-priority", None, None, 0.2),
        ("mainline-priority", None, "ramp.acceleration_lane_m=120.0", 0.5),
        ("mainline-priority", None, "safety.time_gap_s=0.6", 0.4),
        ("uncontrolled", "fair", None, 2.0),
        ("uncontrolled", "fair", "drivers.fair.sigma=0.0", 1.0),
        ("uncontrolled", "fair", "drivers.fair.sigma=0.0 ramp.acceleration_lane_m=120.0", 5.0),
        ("uncontrolled", "paper", "drivers.paper.integrator=ballistic", 0.05),
        ("uncontrolled", "fair", "drivers.fair.car_following=ACC drivers.fair.tau_s=0.6", 8.0),
        ("uncontrolled", "automated-0.6", None, 0.3),
        ("uncontrolled", "automated-0.6", "drivers.automated-0.6.lc_cooperative=0.0", 0.8),
        ("uncontrolled", "automated-0.8", None, 0.6),
        ("uncontrolled", "fair", "drivers.fair.tau_s=0.6", 1.4),
        ("uncontrolled", "credible", None, 20.0),
    ]
    return runs_of(
        *(
            run_row(
                strategy,
                *flow,
                drivers=drivers,
                overrides=overrides,
                vehicles_mainline=300,
                vehicles_ramp=100,
                mainline_delay_s=delay_s,
                ramp_delay_s=delay_s / 2.0,
                breakdown_time_s=900.0 if drivers == "credible" else None,
            )
            for strategy, drivers, overrides, delay_s in made
        )
    )


def test_settings_are_the_scenarios_but_for_the_overrides():
    row = overridden({"scenario": "paper", "drivers": "fair"}, "drivers.fair.sigma=0.0")
    found = settings_of(row)
    assert (found["sigma"], found["integrator"], found["tau_s"]) == (0.0, "euler", 1.0)
    assert found["ramp.acceleration_lane_m"] == 200.0


def test_the_rate_against_each_baseline_by_hand():
    rates, gaps, as_they_are = baseline_tables(baseline_rows())
    assert rates.columns[5:] == ("1800 + 500: D_k (s)", "1800 + 500: I_r (%)")
    assert rates.rows == (
        ("fair", "120", "euler", "0", "1", "5.00", "90.0"),
        ("fair", "200", "euler", "0", "1", "1.00", "80.0"),
        ("fair", "200", "euler", "0.5", "1", "2.00", "90.0"),
        ("paper", "200", "ballistic", "0.5", "1", "0.05", "-"),
    )
    assert gaps.rows == (
        ("Eq. 1", "coordinated, mainline-priority", "0.20 / 0.10"),
        ("0.6", "uncoordinated ACC", "8.00 / 4.00"),
        ("0.6", "automated Krauss, sigma 0, making room", "0.30 / 0.15"),
        ("0.6", "automated Krauss, sigma 0, making no room", "0.80 / 0.40"),
        ("0.6", "drivers, Krauss, sigma 0.5", "1.40 / 0.70"),
        ("0.6", "coordinated, mainline-priority", "0.40 / 0.20"),
        ("0.8", "automated Krauss, sigma 0, making room", "0.60 / 0.30"),
    )
    assert as_they_are.rows == (
        ("fair", "2.00 / 1.00"),
        ("credible", "20.00 / 10.00, b 1 of 1"),
        ("credible-uniform", "-"),
    )


def test_equal_distances_are_time_gap_and_standstill_gap_together():
    flow = (1800.0, 500.0)
    apart = "safety.standstill_gap_m=2.5 safety.time_gap_s=0.6"
    made = [
        ("mainline-priority", None, "safety.time_gap_s=0.6", 0.4),
        ("mainline-priority", None, apart, 0.9),
        ("fifo-optimal-control", None, apart, 0.7),
        ("uncontrolled", "automated-0.6", None, 0.3),
        ("uncontrolled", "automated-0.8", None, 0.6),
        ("uncontrolled", "fair", "drivers.fair.tau_s=0.6", 1.4),
        ("uncontrolled", "fair", "drivers.fair.min_gap_m=1.0 drivers.fair.tau_s=0.6", 1.2),
    ]
    gaps, distances = baseline_tables(
        runs_of(
            *(
                run_row(s, *flow, drivers=d, overrides=o, mainline_delay_s=x, ramp_delay_s=x)
                for s, d, o, x in made
            )
        )
    )
    assert distances.rows == (
        ("0.6 s, 2.5 m", "automated Krauss, sigma 0, making room", "0.30 / 0.30"),
        ("0.6 s, 2.5 m", "drivers, Krauss, sigma 0.5", "1.40 / 1.40"),
        ("0.6 s, 2.5 m", "coordinated, fifo-optimal-control", "0.70 / 0.70"),
        ("0.6 s, 2.5 m", "coordinated, mainline-priority", "0.90 / 0.90"),
    )
    assert ("0.6", "coordinated, mainline-priority", "0.40 / 0.40") in gaps.rows
    assert not any("0.90" in cell for row in gaps.rows for cell in row)


def test_collisions_and_the_unserved_stand_beside_the_delay():
    told = pl.when(pl.col("strategy") == "uncontrolled")
    rows = baseline_rows().with_columns(
        collisions=told.then(7).otherwise(0), unserved=told.then(3).otherwise(0)
    )
    rates, gaps, _ = baseline_tables(rows)
    assert rates.rows[0][5] == "5.00, u 3, c 7"
    assert gaps.rows[1][2] == "8.00 / 4.00, u 3, c 7"
    assert gaps.rows[5][2] == "0.40 / 0.20"


def test_the_figure_of_the_baseline_draws_every_baseline():
    figure = baseline_figure(baseline_rows())
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    assert len(lines["no control, fair drivers, one point per baseline"].get_xdata()) == 3
    assert list(lines["mainline priority"].get_ydata()) == pytest.approx([0.175])
    assert len(figure.axes) == 2


def test_tables_of_nothing_are_empty():
    nothing = pl.DataFrame(schema=RUNS)
    assert baseline_tables(nothing) == []
    assert all(not table.rows for table in field_tables(nothing))


def test_the_baseline_study_has_all_combinations():
    study = load_study("baseline")
    drivers = [s for s in expand(study, 1) if s.drivers is not None]
    settings = [(s.drivers, s.scenario.drivers[s.drivers]) for s in drivers]
    own = [d for name, d in settings if name in ("paper", "fair") and d.car_following == "Krauss"]
    plain = [d for d in own if d.tau_s == 1.0]
    # every baseline at three flows, and fair drivers once more at a fourth
    assert len(plain) == 2 * 2 * 2 * 2 * 3 * 3 + 1
    assert len(own) - len(plain) == 2 * 4  # fair drivers at 0.6 and 1.4 s
    assert sum(d.car_following != "Krauss" for _, d in settings) == 2 * 3 * 4
    automated = [(name, d.lc_cooperative) for name, d in settings if name.startswith("auto")]
    assert len(automated) == 3 * 2 * 4
    assert len(set(automated)) == 3 * 2
    assert sum(name.startswith("credible") for name, _ in settings) == 2 * 4
    assert not math.isnan(count_runs(study, 3))


def test_no_two_kinds_of_the_baseline_figure_share_colour_and_marker():
    drawn = [(colour, marker) for _, colour, marker, _ in KINDS.values()]
    drawn += [(colour, marker) for colour, marker, _ in POPULATIONS.values()]
    assert len(set(drawn)) == len(drawn)
