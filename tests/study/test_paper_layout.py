import math

import pytest

from coramp.studies.definition import Study, expand
from coramp.studies.paper_layout import (
    baseline_table,
    delay_table,
    fuel_table,
    paper_tables,
    rate,
    speed_table,
)
from coramp.studies.paper_results import FUEL_L, MAINLINE_DELAY_S, RAMP_DELAY_S
from coramp.studies.statistics import improvement_rate
from coramp.studies.summary import summary_tables
from tests.study import run_row, runs_of

# Tables 1, 2 and 4 as printed: flows, no control, mainline priority and its rate, ramp priority
# and its rate
TABLE_1 = """
 800 200  4.44 0.23 94.82 0.61 86.26
 800 300  5.01 0.38 92.42 1.10 78.04
 800 500  5.99 0.45 92.49 0.97 83.81
1200 200  7.60 0.26 96.58 0.54 92.89
1200 300  8.55 0.57 93.33 1.19 86.08
1200 500  9.45 0.54 94.29 1.31 86.14
1800 200 15.28 0.54 96.47 0.73 95.22
1800 300 18.04 0.65 96.40 1.24 93.13
1800 500 26.98 0.68 97.48 1.35 95.00
"""
TABLE_2 = """
 800 200  7.35 0.15 97.96 0.46 93.74
 800 300  8.62 0.31 96.40 0.43 95.01
 800 500  9.65 0.33 96.58 0.37 96.17
1200 200  8.54 0.18 97.89 0.45 94.73
1200 300  9.66 0.34 96.48 0.44 95.45
1200 500 12.29 0.44 96.42 0.67 94.55
1800 200 11.47 0.55 95.20 0.71 93.81
1800 300 16.43 0.66 95.98 0.86 94.77
1800 500 20.42 0.59 97.11 0.85 95.84
"""
TABLE_4 = """
 800 200 15.18 15.04 0.92 15.13 0.33
 800 300 16.93 16.47 2.72 16.30 3.72
 800 500 19.65 18.91 3.77 19.17 2.44
1200 200 20.93 20.62 1.48 20.59 1.62
1200 300 22.36 21.77 2.64 21.48 3.94
1200 500 25.02 24.27 3.00 23.80 4.88
1800 200 28.56 28.49 0.25 27.49 3.75
1800 300 29.91 29.64 0.90 28.86 3.51
1800 500 34.76 32.67 6.01 32.95 5.21
"""
PRINTED = [
    (ours, [float(word) for word in line.split()])
    for text, ours in ((TABLE_1, MAINLINE_DELAY_S), (TABLE_2, RAMP_DELAY_S), (TABLE_4, FUEL_L))
    for line in text.strip().splitlines()
]


def test_all_of_the_papers_figures_are_kept_as_printed():
    assert len(PRINTED) == 27
    for ours, (mainline, ramp, uncontrolled, by_mainline, _, by_ramp, _) in PRINTED:
        assert ours[int(mainline), int(ramp)] == (uncontrolled, by_mainline, by_ramp)
    assert len(MAINLINE_DELAY_S) == len(RAMP_DELAY_S) == len(FUEL_L) == 9


def test_all_54_printed_rates_follow_from_the_tables_own_numbers():
    checked = 0
    for ours, (mainline, ramp, _, _, mainline_rate, _, ramp_rate) in PRINTED:
        cell = ours[int(mainline), int(ramp)]
        for controlled, printed in (
            (cell.mainline_priority, mainline_rate),
            (cell.ramp_priority, ramp_rate),
        ):
            share = improvement_rate(controlled, cell.uncontrolled)
            assert 100.0 * share == pytest.approx(printed, abs=0.00501)
            checked += 1
    assert checked == 54


@pytest.mark.parametrize(
    ("controlled", "uncontrolled", "expected"),
    [
        (0.2, 4.0, 0.95),
        (5.0, 4.0, -0.25),
        (0.05, 0.1, 0.5),
        (0.05, 0.0999, math.nan),
        (0.05, -3.0, math.nan),
        (math.nan, 4.0, math.nan),
        (0.2, math.nan, math.nan),
    ],
)
def test_a_rate_needs_a_baseline_that_loses_something(controlled, uncontrolled, expected):
    assert rate(controlled, uncontrolled, 0.1) == pytest.approx(expected, nan_ok=True)


def cells(table, flow="800 + 200"):
    (row,) = [row for row in table.rows if row[0] == flow]
    return dict(zip(table.columns, row, strict=True))


def delays(*rows):
    return delay_table(runs_of(*rows), "T", "mainline_delay_s", MAINLINE_DELAY_S)


RUNS = (
    run_row("mainline-priority", seed=1, mainline_delay_s=0.1),
    run_row("mainline-priority", seed=2, mainline_delay_s=0.3),
    run_row("ramp-priority", seed=1, mainline_delay_s=0.8),
    run_row("uncontrolled", seed=1, drivers="paper", mainline_delay_s=3.0),
    run_row("uncontrolled", seed=2, drivers="paper", mainline_delay_s=5.0),
    run_row("uncontrolled", seed=1, drivers="fair", mainline_delay_s=0.0625),
)


def test_delays_stand_beside_the_papers_with_intervals_and_rates():
    found = cells(delays(*RUNS))
    half = 12.7062 * math.sqrt(0.02) / math.sqrt(2.0)
    assert found["paper D_k"] == "4.44"
    assert found["paper D_m (I_r %)"] == "0.23 (94.8)"
    assert found["paper D_r (I_p %)"] == "0.61 (86.3)"
    assert found["D_m"] == f"0.20 ± {half:.2f}"
    assert found["D_k paper's drivers"] == "4.00 ± 12.71"
    assert found["I_r % paper's"] == f"{100.0 * (1.0 - 0.2 / 4.0):.1f}"
    assert found["D_r"] == "0.80"
    assert found["I_p % paper's"] == f"{100.0 * (1.0 - 0.8 / 4.0):.1f}"


def test_a_dash_stands_where_the_baseline_loses_less_than_a_tenth_of_a_second():
    found = cells(delays(*RUNS))
    assert found["D_k fair drivers"] == "0.06"
    assert found["I_r % fair"] == "-"
    assert found["I_p % fair"] == "-"
    more = run_row("uncontrolled", drivers="fair", mainline_delay_s=0.125)
    assert cells(delays(*RUNS[:5], more))["I_r % fair"] == "-60.0"


def test_a_dash_stands_where_nothing_was_run():
    table = delays(*RUNS)
    for flow in ("800 + 300", "1800 + 500"):
        found = cells(table, flow)
        assert [found[name] for name in table.columns[4:]] == ["-"] * 8
    assert len(table.rows) == 9


def test_the_papers_rates_are_counted_as_reached_where_they_are():
    verdict, legend = delays(*RUNS).notes  # 95.0 % against the paper's 94.8 %
    assert "in 1 of 9 against the paper's drivers and in 0 of 9 against fair ones" in verdict
    assert "A dash stands where the baseline loses less than 0.1 s" in legend
    worse = run_row("mainline-priority", seed=3, mainline_delay_s=0.5)
    verdict, _ = delays(*RUNS, worse).notes
    assert "in 0 of 9 against the paper's drivers" in verdict


def test_runs_with_other_settings_are_left_out():
    other = run_row(seed=9, mainline_delay_s=50.0, overrides="safety.adhesion=0.1")
    assert cells(delays(*RUNS, other)) == cells(delays(*RUNS))


def test_a_shorter_horizon_for_the_whole_study_still_fills_the_tables():
    study = Study(
        name="short",
        scenario="paper",
        layout="paper",
        horizon_s=600.0,
        runs=[{"strategies": ["mainline-priority"], "flows_veh_h": [(800.0, 200.0)]}],
    )
    (spec,) = expand(study, 1)
    runs = runs_of({**run_row(mainline_delay_s=0.25), **spec.keys})
    assert cells(summary_tables(study, runs)[0])["D_m"] == "0.25"


def test_fuel_is_compared_with_every_population():
    runs = runs_of(
        run_row("mainline-priority", fuel_l=18.0),
        run_row("ramp-priority", fuel_l=19.0),
        run_row("uncontrolled", drivers="paper", fuel_l=20.0),
        run_row("uncontrolled", drivers="paper-sigma0", fuel_l=18.0),
        run_row("uncontrolled", drivers="fair", fuel_l=17.0),
    )
    table = fuel_table(runs)
    found = cells(table)
    assert found["paper, no control"] == "15.18"
    assert found["paper, mainline (%)"] == "15.04 (0.9)"
    assert found["mainline priority"] == "18.0"
    assert found["paper's drivers (%)"] == "20.0 (10.0 / 5.0)"
    assert found["paper's, sigma 0 (%)"] == "18.0 (0.0 / -5.6)"
    assert found["fair drivers (%)"] == "17.0 (-5.9 / -11.8)"
    assert found["fair, sigma 0 (%)"] == "- (- / -)"
    assert "paper 1, paper-sigma0 0, fair 0, fair-sigma0 0" in table.notes[0]


def test_speeds_stand_with_their_fluctuation():
    runs = runs_of(
        run_row(mainline_speed_mps=19.5, mainline_speed_std_mps=0.25, ramp_speed_mps=17.5),
        run_row("uncontrolled", drivers="fair", ramp_speed_mps=15.0, ramp_speed_std_mps=1.5),
    )
    found = cells(speed_table(runs))
    assert found["mainline: mainline prio"] == "19.50 (0.25)"
    assert found["ramp: mainline prio"] == "17.50 (-)"
    assert found["ramp: fair drivers"] == "15.00 (1.50)"
    assert found["mainline: paper's drivers"] == "- (-)"


def test_each_stream_alone_is_the_check_of_the_baseline():
    runs = runs_of(
        run_row("uncontrolled", 800.0, 0.0, drivers="paper", mainline_delay_s=6.0),
        run_row("uncontrolled", 800.0, 0.0, drivers="fair", mainline_delay_s=0.5),
        run_row("uncontrolled", 0.0, 300.0, drivers="fair", ramp_delay_s=0.25),
        run_row("uncontrolled", 800.0, 300.0, drivers="fair", mainline_delay_s=9.0),
    )
    assert baseline_table(runs).rows == (("800 + 0", "6.00", "0.50"), ("0 + 300", "-", "0.25"))


def test_the_paper_layout_has_tables_1_2_and_4_speeds_and_the_check():
    titles = [table.title for table in paper_tables(runs_of(*RUNS))]
    assert [title.split(":")[0] for title in titles] == [
        "Table 1",
        "Table 2",
        "Table 4",
        "Mean speed (m/s)",
        "Baseline check",
    ]
