import math
import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from coramp.studies.statistics import (
    Estimate,
    estimate,
    improvement_rate,
    rate_interval,
    ratio_of_sums,
)
from coramp.studies.summary import (
    largest,
    overview,
    promises,
    smallest,
    summary_tables,
    to_markdown,
)
from coramp.studies.tables import Table, number, with_interval
from tests.study import overridden, run_row, runs_of

values = st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=12)


@pytest.mark.parametrize(
    ("count", "quantile"), [(2, 12.706), (3, 4.303), (5, 2.776), (10, 2.262), (31, 2.042)]
)
def test_intervals_use_the_textbooks_quantiles_of_student(count, quantile):
    numbers = [float(k % 2) for k in range(count)]
    spread = statistics.stdev(numbers) / math.sqrt(count)
    assert estimate(numbers).half_width / spread == pytest.approx(quantile, abs=5e-4)


def test_an_interval_worked_out_on_paper():
    # mean 2, variance 1, t = 4.30265
    assert estimate([1.0, 2.0, 3.0]) == pytest.approx((2.0, 4.30265 / math.sqrt(3.0), 3), rel=1e-5)


@given(values)
def test_intervals_agree_with_scipy(numbers):
    mean, half, count = estimate(numbers)
    assert count == len(numbers)
    assert mean == pytest.approx(statistics.fmean(numbers), abs=1e-9)
    deviation = statistics.stdev(numbers)
    if deviation > 1e-6:
        low, high = stats.t.interval(0.95, count - 1, loc=mean, scale=deviation / math.sqrt(count))
        assert (mean - half, mean + half) == pytest.approx((low, high), rel=1e-9, abs=1e-9)
    else:
        assert half < 1e-4


@given(values, st.randoms())
def test_the_order_of_seeds_does_not_matter(numbers, random):
    shuffled = list(numbers)
    random.shuffle(shuffled)
    assert estimate(shuffled) == pytest.approx(estimate(numbers))


def test_one_value_has_no_interval_and_none_has_no_mean():
    mean, half, count = estimate([3.5])
    assert (mean, count) == (3.5, 1)
    assert math.isnan(half)
    mean, half, count = estimate([])
    assert count == 0
    assert math.isnan(mean)
    assert math.isnan(half)


@pytest.mark.parametrize(
    ("controlled", "uncontrolled", "rate"),
    [(0.23, 4.44, 0.9482), (0.15, 7.35, 0.9796), (4.0, 4.0, 0.0), (6.0, 4.0, -0.5), (0.0, 2.0, 1)],
)
def test_improvement_rates_are_those_of_eq_46_and_47(controlled, uncontrolled, rate):
    assert improvement_rate(controlled, uncontrolled) == pytest.approx(rate, abs=5e-5)


def test_without_a_baseline_delay_there_is_no_rate():
    with pytest.raises(ValueError, match="baseline"):
        improvement_rate(0.1, 0.0)


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (1.005, 1, "1.0"),
        (2.0, 2, "2.00"),
        (-1.25, 1, "-1.2"),
        (-0.001, 2, "0.00"),
        (1234.5, 0, "1234"),
        (math.nan, 2, "-"),
        (None, 2, "-"),
        (math.inf, 2, "inf"),
    ],
)
def test_numbers_as_text(value, digits, text):
    assert number(value, digits) == text


def test_intervals_as_text():
    assert with_interval(Estimate(1.234, 0.056, 3)) == "1.23 ± 0.06"
    assert with_interval(Estimate(1.234, math.nan, 1)) == "1.23"
    assert with_interval(Estimate(math.nan, math.nan, 0)) == "-"
    assert with_interval(Estimate(1.25, 0.5, 2), 1) == "1.2 ± 0.5"


def test_a_table_as_markdown():
    table = Table("Title", ("a", "b"), (("1", "2"), ("3", "4")), ("One.", "Two."))
    assert table.to_markdown() == (
        "## Title\n\n| a | b |\n|---|---|\n| 1 | 2 |\n| 3 | 4 |\n\nOne.\n\nTwo.\n"
    )


def test_runs_that_differ_by_their_seed_alone_are_one_row_of_the_overview():
    runs = runs_of(
        run_row(seed=1, mainline_delay_s=1.0, ramp_delay_s=0.5, unserved=1, min_ttc_s=4.0),
        run_row(seed=2, mainline_delay_s=3.0, unserved=2, min_ttc_s=3.0, max_decel_mps2=2.5),
        overridden(run_row(seed=1, mainline_delay_s=7.0), "safety.adhesion=0.1"),
        run_row("uncontrolled", drivers="paper", mainline_delay_s=5.0),
    )
    table = overview(runs)
    rows = [dict(zip(table.columns, row, strict=True)) for row in table.rows]
    assert [(row["setting"], row["strategy"], row["runs"]) for row in rows] == [
        ("as in the scenario", "mainline-priority", "2"),
        ("adhesion φ 0.1", "mainline-priority", "1"),
        ("as in the scenario", "uncontrolled (paper)", "1"),
    ]
    half = 12.7062 * math.sqrt(2.0) / math.sqrt(2.0)
    assert rows[0]["mainline delay (s)"] == f"2.00 ± {half:.2f}"
    assert rows[0]["ramp delay (s)"] == "0.50"
    assert rows[0]["unserved"] == "3"
    assert rows[0]["smallest TTC (s)"] == "3.00"
    assert rows[0]["hardest braking (m/s2)"] == "2.50"
    assert rows[1]["fuel (l)"] == "-"
    assert rows[2]["flow (veh/h)"] == "800 + 200"


def test_promises_count_cooperative_runs_alone():
    runs = runs_of(
        run_row(seed=1, min_margin_m=0.5, plan_error_m=0.004, unserved=1),
        run_row(seed=2, min_margin_m=-0.1, plan_error_m=0.06, safety_violations=2, collisions=1),
        run_row(seed=3, status="failed", error="x"),
        run_row("uncontrolled", collisions=7, safety_violations=9, min_margin_m=-3.0, unserved=5),
    )
    table = promises(runs)
    assert dict(table.rows) == {
        "cooperative runs": "2",
        "runs that broke a promise": "1",
        "collisions in SUMO": "1",
        "safe-distance violations": "2",
        "smallest margin over the safe distance (m)": "-0.100",
        "largest difference between plan and SUMO (m)": "0.0600",
        "vehicles unserved": "1",
        "failed runs": "1",
    }


def test_extremes_of_nothing_are_nan():
    column = runs_of(run_row()).get_column("min_ttc_s")
    assert math.isnan(smallest(column))
    assert math.isnan(largest(column))


@pytest.mark.parametrize("layout", ["plain", "paper", "sensitivity"])
@pytest.mark.parametrize(
    "runs",
    [
        runs_of(),
        runs_of(run_row(status="failed", error="x")),
        runs_of(run_row(mainline=0.0, ramp=0.0)),
        runs_of(run_row(mainline=0.0, ramp_delay_s=0.1)),
    ],
    ids=["none", "all failed", "no vehicles", "no mainline"],
)
def test_a_study_with_little_to_tell_still_has_its_tables(layout, runs):
    from coramp.studies.definition import Study

    study = Study(
        name="s",
        scenario="paper",
        layout=layout,
        runs=[{"strategies": ["mainline-priority"], "flows_veh_h": [(800.0, 200.0)]}],
    )
    tables = summary_tables(study, runs)
    assert [table.title for table in tables][-2:] == ["All runs", "Promises"]
    text = to_markdown(study, tables)
    assert text.startswith("# Study s\n")
    for table in tables:
        assert all(len(row) == len(table.columns) for row in table.rows)
        assert "nan" not in table.to_markdown()


def test_a_ratio_of_sums_has_the_interval_of_a_ratio_estimator():
    # R = 15 / 30; residuals 1 and -1 with t = 12.7062 and s = sqrt(2), over the mean of 15
    found = ratio_of_sums([6.0, 9.0], [10.0, 20.0])
    assert found == pytest.approx((0.5, 12.7062 / 15.0, 2), rel=1e-5)


@given(values)
def test_what_is_in_proportion_has_a_ratio_without_doubt(numbers):
    over = [abs(number) + 1.0 for number in numbers]
    found = ratio_of_sums([3.0 * number for number in over], over)
    assert found.mean == pytest.approx(3.0)
    assert found.half_width == pytest.approx(0.0, abs=1e-9)


def test_there_is_no_ratio_over_nothing():
    assert math.isnan(ratio_of_sums([1.0, 2.0], [0.0, 0.0]).mean)
    assert math.isnan(ratio_of_sums([], []).mean)


def test_a_rate_has_the_exact_interval_of_a_poisson_count():
    # Garwood (1936): 1 in 2 units
    assert rate_interval(1, 2.0) == pytest.approx((0.02532 / 2.0, 5.5716 / 2.0), rel=1e-3)
    assert rate_interval(10, 1.0) == pytest.approx((4.7954, 18.3904), rel=1e-4)


def test_where_nothing_was_counted_the_limit_is_the_rule_of_three():
    low, high = rate_interval(0, 1000.0)
    assert low == 0.0
    assert high == pytest.approx(3.0 / 1000.0, rel=2e-3)
    assert all(math.isnan(limit) for limit in rate_interval(0, 0.0))
