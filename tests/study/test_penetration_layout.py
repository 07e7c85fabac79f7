"""The tables of the study of shares: who stands beside whom, and from which share it pays."""

import pytest

from coramp.studies.definition import count_runs, expand, load_study
from coramp.studies.penetration_layout import penetration_tables, series_of
from coramp.studies.penetration_pareto import front_of
from coramp.studies.penetration_runs import cells_of
from coramp.studies.shown import shown_rows
from coramp.studies.statistics import estimate
from coramp.studies.summary import promises
from tests.study import overridden, run_row, runs_of

MIXED_FIGURES = {
    "automated_vehicles": 5,
    "vehicles_mainline": 8,
    "vehicles_ramp": 2,
    "mainline_delay_s": 1.0,
    "ramp_delay_s": 1.0,
    "mainline_speed_mps": 19.0,
    "ramp_speed_mps": 17.0,
    "fuel_l": 0.5,
}


def row(share, strategy="uncontrolled", delay_s=1.0, gap_s=0.5, seed=1, more="", **figures):
    """A run at 1800 + 500, in which nobody is automated at share 0 and nobody drives at 1."""
    mixed = 0.0 < share < 1.0 or (share == 1.0 and strategy == "uncontrolled")
    drivers = figures.pop("drivers", "fair" if mixed or share == 0.0 else None)
    gap = f"safety.time_gap_s={gap_s} " if share else ""
    own = {**MIXED_FIGURES, "delay_s": delay_s, "driver_delay_s": delay_s, **figures}
    if not mixed:
        own |= {"automated_vehicles": None, "driver_delay_s": None, "driver_hard_brakings_3": None}
    found = run_row(strategy, 1800.0, 500.0, seed, drivers, **own)
    return overridden(found, f"{gap}traffic.automated_share={share}{more}")


def by_seed(values, share, strategy="uncontrolled", **figures):
    return [
        row(share, strategy, delay_s, seed=seed, **figures)
        for seed, delay_s in enumerate(values, 1)
    ]


WITHOUT = by_seed((10.0, 20.0), 0.0, hard_brakings_3=10)


def table_of(rows, title):
    (table,) = [t for t in penetration_tables(runs_of(*rows)) if t.title.startswith(title)]
    return table


def test_every_share_stands_beside_the_same_drivers_without_automated_vehicles():
    rows = [*WITHOUT, *by_seed((6.0, 9.0), 0.5, "mixed-slots")]
    (cell,) = cells_of(runs_of(*rows))
    assert (cell.traffic.name, cell.vehicles, cell.share) == (
        "1800 + 500",
        (0.5, "mixed-slots"),
        0.5,
    )
    # 15 of 30: a ratio of sums, not the mean of 60 and 45 %
    assert cell.delay_share.mean == pytest.approx(50.0)
    # residuals 6 - 0.5 10 and 9 - 0.5 20 are 1 and -1; over the mean of 15
    half = estimate([1.0, -1.0]).half_width
    assert cell.delay_share.half_width == pytest.approx(100.0 * half / 15.0)
    assert cell.saved_s[:2] == estimate([4.0, 11.0])[:2]


def test_seeds_without_a_partner_do_not_count():
    rows = [*WITHOUT, *by_seed((6.0, 9.0, 500.0), 0.5, "mixed-slots")]
    (cell,) = cells_of(runs_of(*rows))
    assert cell.delay_share.mean == pytest.approx(50.0)


def test_automation_alone_is_named_by_how_it_drives():
    more = " traffic.automation=cacc"
    rows = [*WITHOUT, row(0.5), row(0.5, more=more), row(0.5, "mixed-slots"), row(0.5, gap_s=1.0)]
    assert [series.names for series in series_of(runs_of(*rows))] == [
        ("fair", "1800 + 500", "0.5", "mixed-slots"),
        ("fair", "1800 + 500", "0.5", "alone, yielding"),
        ("fair", "1800 + 500", "0.5", "alone, CACC"),
        ("fair", "1800 + 500", "1.0", "alone, yielding"),
    ]


def test_who_are_all_automated_stand_at_the_end_of_every_population_that_has_the_same_vehicles():
    credible = [row(0.0, drivers="credible"), row(0.5, "mixed-slots", drivers="credible")]
    rows = [*WITHOUT, *credible, row(1.0, "mixed-slots"), row(1.0, "mixed-slots", gap_s=1.0)]
    found = {series.names: [c.share for c in series.cells] for series in series_of(runs_of(*rows))}
    assert found == {
        ("fair", "1800 + 500", "1.0", "mixed-slots"): [1.0],
        ("credible", "1800 + 500", "0.5", "mixed-slots"): [0.5, 1.0],
        ("credible", "1800 + 500", "1.0", "mixed-slots"): [1.0],
    }


def test_figures_of_a_kind_are_those_of_all_where_there_is_no_other():
    rows = [*WITHOUT, row(1.0, "mixed-slots", delay_s=3.0, hard_brakings_3=2)]
    (cell,) = cells_of(runs_of(*rows))
    assert (cell.mean("automated_delay_s").mean, cell.total("automated_hard_brakings_3")) == (3, 2)
    assert (cell.mean("driver_delay_s").values, cell.total("driver_hard_brakings_3")) == (0, 0)
    without = cell.without[1]
    assert (without["driver_delay_s"], without["driver_hard_brakings_3"]) == (10.0, 10)


def test_it_pays_from_where_every_larger_share_pays_for_sure():
    steady = [*WITHOUT, *by_seed((5.0, 15.1), 0.2), *by_seed((4.0, 14.1), 0.5)]
    chance = [*WITHOUT, *by_seed((5.0, 15.1), 0.2), *by_seed((9.0, 1.0), 0.5)]
    late = [*WITHOUT, *by_seed((12.0, 22.1), 0.2), *by_seed((4.0, 14.1), 0.5)]
    told = [table_of(rows, "From which").rows[0][4] for rows in (steady, chance, late)]
    assert told == ["20 %", "nowhere", "50 %"]


def test_breakdown_is_gone_from_where_no_larger_share_has_any():
    broken, held = {"mainline_delay_s": 9.0}, {"mainline_delay_s": 1.0}
    without = by_seed((10.0, 20.0), 0.0, **broken)
    more = [*by_seed((4, 4), 0.2, **held), *by_seed((4, 4), 0.5, **broken), row(0.8)]
    rows = [*without, *more]
    assert table_of(rows, "From which").rows[0][6] == "80 %"
    assert table_of([*WITHOUT, *more], "From which").rows[0][6] == "80 %, and at 0 %"
    cells = table_of(rows, "Seeds that broke").rows[0]
    assert cells[4:] == ("2 of 2", "0 of 2", "2 of 2", "0 of 1")


def test_coordination_stands_beside_automation_alone_at_the_same_gap_and_share():
    own = by_seed((6.0, 8.0), 0.5, "mixed-slots", hard_brakings_3=1, driver_hard_brakings_3=1)
    alone = by_seed((5.0, 6.0), 0.5, hard_brakings_3=4, driver_hard_brakings_3=2)
    others = [row(0.2), row(0.5, gap_s=1.0)]
    table = table_of([*WITHOUT, *own, *alone, *others], "Delay against")
    (cells,) = [dict(zip(table.columns, cells, strict=True)) for cells in table.rows]
    assert (cells["share"], cells["beside"]) == ("50 %", "alone, yielding")
    assert cells["slower by (s)"].startswith("1.50 ±")
    assert (cells["its brakings, all"], cells["beside, all"], cells["% of those"]) == (
        "2",
        "8",
        "25",
    )
    assert cells["front, all"] == "both"


@pytest.mark.parametrize(
    ("own", "other", "front"),
    [
        ((1.0, 2.0), (2.0, 1.0), (True, True)),
        ((1.0, 2.0), (1.0, 3.0), (True, False)),
        ((2.0, 2.0), (1.0, 2.0), (False, True)),
        ((1.0, 1.0), (1.0, 1.0), (True, True)),
    ],
)
def test_the_front_is_who_is_not_beaten(own, other, front):
    assert front_of(own, other) == front


def test_collisions_are_told_by_cause():
    mixed = row(0.5, "mixed-slots", collisions_by_driver=2, automated_violations=3)
    rows = [row(0.0, collisions=4, collisions_by_automated=None), mixed]
    rows[0] |= dict.fromkeys(("collisions_by_driver", "collisions_among_drivers"))
    table = table_of(rows, "Speed, fuel")
    place = table.columns.index("collisions by automated, by driver, among drivers")
    assert [cells[place] for cells in table.rows] == ["0, 0, 4", "0, 2, 0"]
    assert table.rows[1][table.columns.index("nearer than promised")] == "3"


def test_what_was_promised_among_drivers_is_told_apart_and_automation_alone_promises_nothing():
    alone = row(0.5, automated_violations=9, plan_error_m=None)
    mixed = row(0.5, "mixed-slots", automated_violations=2, plan_error_m=0.01)
    told = dict(promises(runs_of(*WITHOUT, alone, mixed)).rows)
    assert told["runs coordinated among drivers"] == "1"
    assert told["of these, runs that broke a promise"] == "1"


def test_the_report_shows_the_middle_of_the_settings_with_which_most_strategies_ran():
    shares = (0.2, 0.5, 0.8)
    rows = [*WITHOUT, *(row(share) for share in shares), row(0.9)]
    rows += [row(share, "mixed-slots") for share in shares]
    shown = shown_rows(runs_of(*rows))
    assert {r["overrides"] for r in shown} == {"safety.time_gap_s=0.5 traffic.automated_share=0.5"}
    assert {r["strategy"] for r in shown} == {"mixed-slots", "uncontrolled"}


def test_the_built_in_study_has_every_share_and_its_baseline_and_is_small_enough():
    study = load_study("penetration")
    specs = expand(study, 1)
    assert len(specs) == count_runs(study, 1)
    # 45 minutes on two cores: a run takes 1.2 s of one
    assert study.seeds * len(specs) < 2.0 * 45.0 * 60.0 / 1.8
    shares = {spec.scenario.traffic.automated_share for spec in specs}
    assert {k / 10 for k in range(11)} <= shares
    baselines = {
        (spec.drivers, spec.scenario.mainline.flow_veh_h, spec.scenario.ramp.flow_veh_h)
        for spec in specs
        if spec.scenario.traffic.automated_share == 0.0
    }
    ran = {
        (spec.drivers, spec.scenario.mainline.flow_veh_h, spec.scenario.ramp.flow_veh_h)
        for spec in specs
        if spec.drivers is not None
    }
    assert ran == baselines


def test_no_runs_give_no_tables():
    assert penetration_tables(runs_of(*WITHOUT)) == []
