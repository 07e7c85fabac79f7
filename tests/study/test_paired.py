"""Differences on the same arrivals, and their figure, against rows made by hand."""

import math

import pytest

from coramp import CorampError
from coramp.report.varied_figure import dimensions, varied, varied_figure
from coramp.studies.definition import Study
from coramp.studies.paired import EVERY_PAIR_OF, differences, paired_table
from coramp.studies.summary import summary_tables
from tests.study import overridden, run_row, runs_of

T_OF_3 = 4.302652729911275
"""Student's t for 95 % with two degrees of freedom."""


def delays(strategy, by_seed, overrides=None, **more):
    return [
        overridden(
            run_row(
                strategy,
                seed=seed,
                delay_s=delay_s,
                mainline_delay_s=2.0 * delay_s,
                ramp_delay_s=0.5 * delay_s,
                **more,
            ),
            overrides,
        )
        for seed, delay_s in enumerate(by_seed, 1)
    ]


SLOTS = delays("slots", (1.0, 5.0, 9.0))
OTHER = delays("mainline-priority", (1.5, 5.7, 9.6))


def test_what_differs_little_from_seed_to_seed_is_told_although_the_means_do():
    (found,) = differences(runs_of(*OTHER, *SLOTS))
    assert (found.less.name, found.more.name) == ("slots", "mainline-priority")
    mean, half_width, seeds = found.by_s[0]
    assert mean == pytest.approx(0.6)
    assert half_width == pytest.approx(T_OF_3 * 0.1 / math.sqrt(3.0))
    assert seeds == 3
    assert found.told_apart
    assert found.by_s[1].mean == pytest.approx(1.2)
    assert found.by_s[2].mean == pytest.approx(0.3)


def test_seeds_that_only_one_has_do_not_count():
    (found,) = differences(runs_of(*OTHER[:2], *SLOTS))
    assert found.by_s[0].values == 2
    assert differences(runs_of(*OTHER[:1], *SLOTS)) == []


def test_an_interval_with_zero_in_it_is_not_sure():
    table = paired_table(runs_of(*delays("game", (1.0, 6.0, 8.0)), *SLOTS))
    row = dict(zip(table.columns, table.rows[0], strict=True))
    assert row["sure"] == "no"
    assert row["by, all (s)"] == "0.00 ± 2.48"  # 0, 1 and -1


def test_settings_are_compared_where_they_say_nothing_of_arrivals():
    gap = delays("slots", (1.2, 5.1, 9.3), "safety.time_gap_s=1.0")
    (found,) = differences(runs_of(*SLOTS, *gap))
    assert found.more.name == "slots, time gap 1.0 s"
    entry = delays("slots", (1.2, 5.1, 9.3), "mainline.entry_speed_mps=17.0")
    assert differences(runs_of(*SLOTS, *entry)) == []


def test_other_flows_and_two_things_at_once_are_not_compared():
    elsewhere = delays("game", (2.0, 3.0, 4.0), mainline=900.0)
    both = delays("game", (2.0, 3.0, 4.0), "safety.time_gap_s=1.0")
    assert differences(runs_of(*SLOTS, *elsewhere, *both)) == []


def test_what_loses_the_same_with_every_seed_is_left_out():
    same = delays("uncontrolled", (1.0, 5.0, 9.0), "safety.time_gap_s=1.0")
    assert differences(runs_of(*delays("uncontrolled", (1.0, 5.0, 9.0)), *same)) == []
    assert paired_table(runs_of(*SLOTS)) is None


def test_of_many_only_pairs_with_the_best_are_told():
    names = ("slots", "game", "ocbf", "dp-sequence", "milp-sequence")
    rows = [row for k, n in enumerate(names) for row in delays(n, (1.0 + k, 2.0 + k, 3.1 + k * k))]
    found = differences(runs_of(*rows))
    assert len(names) > EVERY_PAIR_OF
    assert len(found) == len(names) - 1
    assert {difference.less.strategy for difference in found} == {"slots"}


def test_two_populations_of_drivers_are_not_compared():
    fair = delays("uncontrolled", (2.0, 6.0, 10.0), drivers="fair")
    credible = delays("uncontrolled", (3.0, 7.1, 11.0), drivers="credible")
    metered = delays("alinea", (3.5, 7.2, 11.9), drivers="credible")
    runs = runs_of(*SLOTS, *OTHER, *fair, *credible, *metered)
    pairs = {frozenset({d.less.name, d.more.name}) for d in differences(runs)}
    of_fair, of_credible = "uncontrolled (fair drivers)", "uncontrolled (credible drivers)"
    assert {of_fair, "slots"} in pairs
    assert {of_credible, "slots"} in pairs
    assert {"alinea (credible drivers)", "slots"} in pairs
    assert not any({of_fair, of_credible} <= pair for pair in pairs)
    assert not any({of_fair, "alinea (credible drivers)"} <= pair for pair in pairs)
    assert "two populations are not compared" in paired_table(runs).notes[-1]
    assert differences(runs_of(*fair, *credible)) == []


def test_a_study_of_ones_own_has_the_table():
    study = Study.model_validate(
        {
            "name": "own",
            "scenario": "paper",
            "runs": [{"strategies": ["slots"], "flows_veh_h": [[800, 200]]}],
        }
    )
    titles = [table.title for table in summary_tables(study, runs_of(*SLOTS, *OTHER))]
    assert titles == ["All runs", "Differences on the same arrivals", "Promises"]


def errorbars(axes):
    """Means and half widths of each line, by its label."""
    return {
        container.get_label(): (
            list(container.lines[0].get_ydata()),
            [
                0.5 * (segment[1][1] - segment[0][1])
                for segment in container.lines[2][0].get_segments()
            ],
        )
        for container in axes.containers
    }


def test_delay_and_the_difference_are_drawn_over_what_varies():
    gap = delays("slots", (2.0, 6.0, 10.0), "safety.time_gap_s=1.0")
    other = delays("mainline-priority", (3.0, 7.2, 10.9), "safety.time_gap_s=1.0")
    low = delays("slots", (1.0, 5.0, 9.0), "safety.time_gap_s=0.6")
    low_other = delays("mainline-priority", (1.5, 5.7, 9.6), "safety.time_gap_s=0.6")
    runs = runs_of(*low, *low_other, *gap, *other)
    assert dimensions(varied(runs)) == ["safety.time_gap_s", "strategy"]
    figure = varied_figure(runs)
    assert [axes.get_title() for axes in figure.axes[:3]] == ["all vehicles", "mainline", "ramp"]
    assert figure.axes[-1].get_xlabel() == "time gap (s)"
    assert [t.get_text() for t in figure.axes[-1].get_xticklabels()] == ["0.6", "1"]
    means = errorbars(figure.axes[0])
    assert means["slots"][0] == pytest.approx([5.0, 6.0])
    assert means["mainline priority"][0] == pytest.approx([5.6, 21.1 / 3.0])
    differences_s, half_widths_s = errorbars(figure.axes[3])["mainline priority"]
    assert differences_s == pytest.approx([0.6, 31.0 / 30.0])
    assert half_widths_s[0] == pytest.approx(T_OF_3 * 0.1 / math.sqrt(3.0))


def test_what_else_varies_has_rows_of_its_own_and_what_does_not_is_refused():
    flows = [row for m in (800.0, 900.0) for row in delays("slots", (1.0, 2.0), mainline=m)]
    gaps = [
        row
        for m in (800.0, 900.0)
        for row in delays("slots", (1.1, 2.0), "safety.time_gap_s=1.0", mainline=m)
    ]
    runs = runs_of(*flows, *gaps)
    figure = varied_figure(runs)
    assert len(figure.axes) == 6  # two settings, each with all, mainline and ramp
    assert [t.get_text() for t in figure.axes[-1].get_xticklabels()] == ["800 + 200", "900 + 200"]
    over = varied_figure(runs, "safety.time_gap_s")
    assert [t.get_text() for t in over.axes[-1].get_xticklabels()] == ["1", "as it is"]
    with pytest.raises(CorampError, match=r"^over: wind does not vary; allowed are flow, safety"):
        varied_figure(runs, "wind")
