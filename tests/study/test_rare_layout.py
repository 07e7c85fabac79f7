"""Rates of rare events from runs that are drawn for them: which runs, with which weights."""

import math

import pytest

from coramp.studies.definition import expand, load_study
from coramp.studies.hostile_layout import hostile_tables
from coramp.studies.hostile_runs import cells_of
from coramp.studies.importance import effective_size
from coramp.studies.rare_layout import KM_PER_BRAKING, drawn_of, rare_tables
from coramp.worlds.faults.brakings import due_s
from tests.study import overridden, run_row, runs_of

DRAWN = (
    "behaviour.brake_mps2=8.0 behaviour.brakes_for_nothing_per_h=40.0 safety.time_gap_s=0.5 "
    "simulation.horizon_s=90.0 traffic.automated_share=0.5"
)
SEEDS = range(1, 13)
BRAKINGS = {seed: len(due_s(40.0, seed, 90.0)) for seed in SEEDS}


def row(seed, overrides=DRAWN, **figures):
    found = run_row("mixed-slots", 2200.0, 700.0, seed, "fair", vehicle_km=50.0, **figures)
    return overridden(found, overrides)


def rows_with(**events):
    """The runs of twelve seeds, each with these events."""
    return [row(seed, **events) for seed in SEEDS]


def by_event(rows):
    (table,) = rare_tables(runs_of(*rows))
    found = [dict(zip(table.columns, cells, strict=True)) for cells in table.rows]
    return {cells["event"]: cells for cells in found}


def ratio(seed):
    """By hand: 50 km are 0.005 brakings, 40 an hour for 90 s are one."""
    return (0.005 / 1.0) ** BRAKINGS[seed] * math.exp(1.0 - 0.005)


def test_the_seeds_of_these_tests_have_runs_with_and_without_a_braking():
    assert min(BRAKINGS.values()) == 0
    assert {1, 2} <= set(BRAKINGS.values())


def test_runs_with_a_braking_count_with_their_likelihood_ratio():
    assert KM_PER_BRAKING == 10_000.0
    found = drawn_of(rows_with())
    braked = [seed for seed in SEEDS if BRAKINGS[seed]]
    assert [run["seed"] for run in found.braked] == braked
    assert found.weights == pytest.approx([ratio(seed) for seed in braked])
    assert (found.runs, found.vehicle_km) == (12, 600.0)


def test_a_rate_is_the_weighted_sum_over_the_distance_of_all_runs():
    with_one = next(seed for seed in SEEDS if BRAKINGS[seed] == 1)
    with_two = next(seed for seed in SEEDS if BRAKINGS[seed] == 2)
    events = {with_one: 3, with_two: 1}
    rows = [row(seed, collisions=events.get(seed, 0)) for seed in SEEDS]
    cells = by_event(rows)["collision"]
    rate = 1e6 * (3.0 * ratio(with_one) + ratio(with_two)) / 600.0
    assert float(cells["rate per million vehicle km"].split(" ")[0]) == pytest.approx(
        rate, rel=0.05
    )
    assert cells["events seen"] == "4"
    assert cells["runs"] == "12"
    assert cells["vehicle km"] == "600"
    weights = [ratio(seed) for seed in SEEDS if BRAKINGS[seed]]
    size = f"{effective_size(weights):.1f}, 1.0 with an event"
    assert cells["effective sample size"] == size


def test_events_without_a_braking_do_not_count():
    rows = [row(seed, collisions=int(BRAKINGS[seed] == 0)) for seed in SEEDS]
    cells = by_event(rows)["collision"]
    assert cells["events seen"] == "0"
    limit = -math.log(0.05) * 1e6 * max(ratio(seed) for seed in SEEDS if BRAKINGS[seed]) / 600.0
    told = cells["rate per million vehicle km"]
    assert told.startswith("0 (below ")
    assert float(told[len("0 (below ") : -1]) == pytest.approx(limit, rel=0.05)


def test_events_that_a_kind_of_run_does_not_have_are_left_out():
    found = by_event(rows_with(collisions_by_automated=None, automated_violations=None))
    assert set(found) == {"collision", "DRAC > 6 m/s2", "TTC < 1 s"}


def test_where_nobody_brakes_nothing_is_told():
    quiet = [row(seed) for seed in SEEDS if BRAKINGS[seed] == 0]
    assert by_event(quiet)["collision"]["rate per million vehicle km"] == "-"


def test_faults_beside_the_braking_are_named():
    rows = [row(1), row(1, f"{DRAWN} world.preset=hard")]
    (table,) = rare_tables(runs_of(*rows))
    assert list(dict.fromkeys(cells[0] for cells in table.rows)) == [
        "braking for nothing at 8 m/s2",
        "braking for nothing at 8 m/s2, hard",
    ]


def test_weighted_runs_are_in_no_other_table():
    rows = rows_with(collisions_by_driver=1)
    assert cells_of(runs_of(*rows)) == []
    assert [table.title for table in hostile_tables(runs_of(*rows))] == [
        "Rare collisions by importance sampling"
    ]
    setting = "safety.time_gap_s=0.5 traffic.automated_share=0.5"
    ordinary = row(1, setting, delay_s=1.0, automated_vehicles=5)
    assert rare_tables(runs_of(ordinary)) == []
    assert len(hostile_tables(runs_of(ordinary, *rows))) == 7


def test_the_built_in_study_draws_one_braking_a_run_and_many_runs():
    specs = [s for s in expand(load_study("hostile"), 1) if s.scenario.simulation.horizon_s < 900.0]
    assert {spec.seed for spec in specs} == set(range(1, 13))
    for spec in specs:
        behaviour, horizon_s = spec.scenario.behaviour, spec.scenario.simulation.horizon_s
        assert behaviour.brakes_for_nothing_per_h * horizon_s / 3600.0 == pytest.approx(1.0)
        assert behaviour.brake_mps2 > 6.0
    # three minutes on two cores: a run takes 0.4 s of one
    assert 6 * len(specs) * 0.4 < 2.0 * 180.0
