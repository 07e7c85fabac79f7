"""The tables of the study of faults: what stands beside what, and how rare a collision can be."""

import math

import pytest

from coramp.scenarios.world_sections import PRESETS
from coramp.studies.definition import count_runs, expand, load_study
from coramp.studies.hostile_layout import hostile_tables
from coramp.studies.hostile_runs import cells_of, counted, fault_name
from coramp.studies.statistics import estimate
from tests.study import overridden, run_row, runs_of

FIGURES = {
    "automated_vehicles": 5,
    "vehicles_mainline": 80,
    "vehicles_ramp": 20,
    "vehicle_km": 500.0,
    "mainline_delay_s": 1.0,
    "ramp_delay_s": 1.0,
}


def row(share, delay_s=1.0, fault="", seed=1, strategy="mixed-slots", drivers="fair", **figures):
    """A run at 1800 + 500 with a fault, as settings in words."""
    found = run_row(
        strategy, 1800.0, 500.0, seed, drivers, **{**FIGURES, "delay_s": delay_s, **figures}
    )
    gap = "" if strategy == "uncontrolled" else " safety.time_gap_s=0.5"
    return overridden(found, f"{fault}{gap} traffic.automated_share={share}".strip())


def by_seed(values, share, fault="", **figures):
    return [row(share, delay_s, fault, seed, **figures) for seed, delay_s in enumerate(values, 1)]


HARD = "world.preset=hard"
PERFECT = by_seed((10.0, 20.0), 0.5)


def table_of(rows, title):
    (table,) = [t for t in hostile_tables(runs_of(*rows)) if t.title.startswith(title)]
    return table


def by_column(table, place=0):
    return dict(zip(table.columns, table.rows[place], strict=True))


def test_every_fault_stands_beside_a_perfect_world_with_the_same_share():
    rows = [*PERFECT, *by_seed((12.0, 27.0), 0.5, HARD), *by_seed((5.0, 5.0), 0.25)]
    cells = {(c.line.fault, c.share): c for c in cells_of(runs_of(*rows))}
    assert list(cells) == [("perfect", 0.25), ("perfect", 0.5), ("hard", 0.5)]
    found = cells["hard", 0.5]
    # 39 of 30: a ratio of sums, not the mean of 120 and 135 %
    assert found.delay_share.mean == pytest.approx(130.0)
    assert found.lost_s[:2] == estimate([2.0, 7.0])[:2]


def test_seeds_without_a_partner_do_not_count():
    rows = [*PERFECT, *by_seed((12.0, 27.0, 900.0), 0.5, HARD)]
    assert cells_of(runs_of(*rows))[1].delay_share.mean == pytest.approx(130.0)


def test_who_are_all_automated_stand_beside_slots_among_the_same_drivers():
    planned = row(1.0, 2.0, drivers=None, automated_vehicles=None, vehicle_km=None)
    rows = [*PERFECT, planned, row(0.5, fault=HARD), row(1.0, 3.0, HARD)]
    cells = {(c.line.fault, c.share): c for c in cells_of(runs_of(*rows))}
    assert cells["hard", 1.0].line.drivers == cells["perfect", 1.0].line.drivers == "fair"
    assert cells["hard", 1.0].delay_share.mean == pytest.approx(150.0)
    assert counted([cells["perfect", 1.0]]).runs == 0


def test_drivers_alone_stand_beside_drivers_alone():
    brakes = "behaviour.brakes_for_nothing_per_h=60.0"
    alone = {"strategy": "uncontrolled", "automated_vehicles": None, "collisions": 2}
    rows = [*PERFECT, row(0.0, 4.0, **alone), row(0.0, 6.0, brakes, **alone), row(0.5, 1.0, brakes)]
    table = table_of(rows, "Delay of all")
    found = {(r[0], r[1]): r[-2:] for r in table.rows}
    assert found["braking for nothing (60/h)", "drivers alone"] == ("150", "-")
    assert found["braking for nothing (60/h)", "mixed-slots"][0] == "-"
    causes = {(r[0], r[1]): r[6:9] for r in table_of(rows, "Collisions by cause").rows}
    assert causes["perfect", "drivers alone"][2].startswith("2 (4000: ")


def test_collisions_have_exact_intervals_and_none_the_rule_of_three():
    rows = [*PERFECT, *by_seed((1.0, 1.0), 0.5, HARD, collisions_by_driver=1)]
    own = by_column(table_of(rows, "Collisions by cause"), 1)
    # Garwood for 2: 0.2422 to 7.2247, over 1,000 km
    assert own["by driver"] == "2 (2000: 242 to 7225)"
    assert own["collisions by automated"] == f"0 (below {-math.log(0.05) * 1e3:.0f})"
    assert (own["runs"], own["vehicle km"]) == ("2", "1000")


def test_where_it_happened_is_told_and_nothing_else():
    rows = [*PERFECT, row(0.5, fault=HARD, automated_violations=3), row(0.25, fault=HARD)]
    (cells,) = table_of(rows, "Where vehicles").rows
    assert cells[0] == "hard"
    assert cells[-5:] == ("50 %", "0", "0", "0", "3")


def test_messages_and_stops_are_told_as_parts():
    more = {"reports_sent": 200, "reports_lost": 30, "commands_sent": 100, "fallbacks": 5}
    rows = [*PERFECT, row(0.5, fault=HARD, **more, ramp_stops=1, driver_hard_brakings_3=7)]
    cells = by_column(table_of(rows, "Messages"), 1)
    assert (cells["reports lost (%)"], cells["commands lost (%)"]) == ("15.0", "0.0")
    assert cells["fallbacks, per 1,000 vehicles"] == "50.0"
    assert (cells["of drivers"], cells["stopped on the ramp (%)"]) == ("70.0", "5.0")


def test_conflicts_are_rates_over_the_runs_that_have_them():
    without = {"conflicts_ttc_3": None, "vehicle_km": 500.0}
    rows = [*PERFECT, row(0.5, fault=HARD, conflicts_ttc_3=4), row(0.25, fault=HARD, **without)]
    cells = by_column(table_of(rows, "Conflicts"), 1)
    assert (cells["TTC < 3 s"], cells["TTC < 1 s"]) == ("8.0", "0.0")


@pytest.mark.parametrize(
    ("faults", "name"),
    [
        ({}, "perfect"),
        ({"world.preset": "winter"}, "winter"),
        ({"behaviour.lies_share": 0.2, "behaviour.lie_m": 20.0}, "liars (20 %)"),
        (
            {"incidents.breakdown_s": 300.0, "incidents.place": "ramp"},
            "breakdown at 300 s on the ramp",
        ),
        ({"reports.loss": 0.5}, "reports.loss 0.5"),
        (
            {"world.preset": "mild", "reports.loss": 0.5},
            "reports.loss 0.5, world.preset mild",
        ),
    ],
)
def test_faults_are_called_by_name(faults, name):
    assert fault_name(faults) == name


def test_the_built_in_study_has_every_preset_at_every_share_and_is_large_and_small_enough():
    study = load_study("hostile")
    specs = expand(study, 1)
    assert len(specs) == count_runs(study, 1)
    ran = {
        (dict(spec.overrides).get("world.preset"), spec.scenario.traffic.automated_share)
        for spec in specs
    }
    assert {(preset, share) for preset in PRESETS for share in (0.25, 0.5, 0.75, 1.0)} <= ran
    # 45 minutes on two cores: a run of 900 s takes 4 s of one
    driven_s = sum(spec.scenario.simulation.horizon_s for spec in specs)
    assert study.seeds * driven_s < 2.0 * 45.0 * 60.0 / (4.0 / 900.0)
    # 1,000 vehicle km a preset: a run has 400 at the least
    assert 8 * study.seeds * 400.0 > 1000.0


def test_every_run_with_a_fault_has_its_partner_in_a_perfect_world():
    def key(spec):
        return spec.strategy, spec.scenario.traffic.automated_share, spec.keys["mainline_veh_h"]

    specs = expand(load_study("hostile"), 1)
    perfect = {key(spec) for spec in specs if not spec.scenario.has_faults}
    assert {key(spec) for spec in specs if spec.scenario.has_faults} == perfect


def test_no_runs_give_no_tables():
    assert hostile_tables(runs_of()) == []
