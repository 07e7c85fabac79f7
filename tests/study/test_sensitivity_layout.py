import pytest

from coramp.studies.sensitivity_layout import sensitivity_tables, still_merges
from tests.study import run_row, runs_of


def run(mainline, ramp, setting=None, delays=(1.0, 1.0), **rest):
    figures = {"mainline_delay_s": delays[0], "ramp_delay_s": delays[1], "overrides": setting}
    return run_row(mainline=mainline, ramp=ramp, **figures, **rest)


def merging_flows(*rows):
    (table,) = sensitivity_tables(runs_of(*rows))
    return {row[0]: row[-1] for row in table.rows}


def test_each_setting_is_a_row_and_each_flow_a_column():
    (table,) = sensitivity_tables(
        runs_of(
            run(800.0, 200.0, delays=(1.0, 2.0)),
            run(1200.0, 300.0, delays=(1.5, 2.5)),
            run(800.0, 200.0, "safety.adhesion=0.1", delays=(3.0, 4.0), unserved=2),
        )
    )
    assert table.title == "Sensitivity: mainline-priority"
    assert table.columns == (
        "setting",
        "800 + 200",
        "1200 + 300",
        "flow that still merges (veh/h)",
    )
    assert table.rows == (
        ("as in the scenario", "1.00 / 2.00", "1.50 / 2.50", "1500"),
        ("safety.adhesion=0.1", "3.00 / 4.00, u 2", "-", "-"),
    )


def test_seeds_are_summed_up_with_intervals():
    (table,) = sensitivity_tables(
        runs_of(
            run(800.0, 200.0, seed=1, delays=(1.0, 2.0), unserved=1),
            run(800.0, 200.0, seed=2, delays=(3.0, 2.0), unserved=3),
        )
    )
    assert table.rows[0][1] == "2.00 ± 12.71 / 2.00 ± 0.00, u 4"


def test_each_strategy_has_a_table():
    tables = sensitivity_tables(
        runs_of(run(800.0, 200.0), run(800.0, 200.0, strategy="ramp-priority"))
    )
    assert [table.title for table in tables] == [
        "Sensitivity: mainline-priority",
        "Sensitivity: ramp-priority",
    ]


@pytest.mark.parametrize(
    ("delays", "unserved", "expected"),
    [
        ((1.0, 1.0), 0, True),
        ((5.0, 5.0), 0, True),
        ((5.01, 1.0), 0, False),
        ((1.0, 5.01), 0, False),
        ((1.0, 1.0), 1, False),
        ((None, 1.0), 0, True),
        ((1.0, None), 0, True),
        ((None, 7.0), 0, False),
    ],
)
def test_a_flow_merges_while_no_stream_loses_5_s_and_nobody_is_left(delays, unserved, expected):
    runs = runs_of(run(800.0, 200.0, delays=delays, unserved=unserved))
    assert still_merges(runs) is expected


def test_it_is_the_mean_over_seeds_that_counts():
    runs = [run(800.0, 200.0, seed=k, delays=(delay, 0.0)) for k, delay in enumerate((2.0, 7.0))]
    assert still_merges(runs_of(*runs))
    assert not still_merges(runs_of(runs[1]))


def test_the_flow_that_still_merges_is_the_largest_that_does():
    assert merging_flows(
        run(800.0, 200.0),
        run(1200.0, 300.0),
        run(1800.0, 500.0, delays=(9.0, 9.0)),
        run(800.0, 200.0, "x=1", delays=(9.0, 9.0)),
    ) == {"as in the scenario": "1500", "x=1": "-"}


def test_the_largest_flow_counts_both_streams():
    assert merging_flows(run(1000.0, 900.0), run(1200.0, 100.0)) == {"as in the scenario": "1900"}


def test_a_run_without_vehicles_is_no_reason_to_fail():
    (table,) = sensitivity_tables(runs_of(run(0.0, 0.0, delays=(None, None)), run(800.0, 200.0)))
    assert table.rows[0][-1] == "1000"
