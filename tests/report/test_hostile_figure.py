"""The figure of the study of faults, and the answer of its report, from rows made by hand."""

import pytest

from coramp.report.hostile_figure import hostile_figure
from coramp.report.page.study_answer import hostile_answer
from tests.study import runs_of
from tests.study.test_hostile_layout import HARD, PERFECT, by_seed, row


@pytest.fixture(scope="module")
def runs():
    hard = by_seed((12.0, 27.0), 0.5, HARD, conflicts_ttc_1_5=2, collisions_by_driver=1)
    return runs_of(*PERFECT, *hard, row(0.25, 4.0, HARD), row(0.25, 2.0))


def points_of(axes):
    """Returns each labelled series' points: value and fault."""
    names = [label.get_text() for label in axes.figure.axes[0].get_yticklabels()]
    return {
        container.get_label(): {
            names[round(y)]: pytest.approx(x)
            for x, y in zip(*container.lines[0].get_data(), strict=True)
        }
        for container in axes.containers
    }


def test_delay_is_drawn_against_a_perfect_world_and_conflicts_beside_it(runs):
    delays, conflicts = hostile_figure(runs).axes
    assert points_of(delays) == {
        "25 % automated": {"perfect": 100.0, "hard": 200.0},
        "50 % automated": {"perfect": 100.0, "hard": 130.0},
    }
    assert points_of(conflicts)["50 % automated"] == {"perfect": 0.0, "hard": 4.0}
    assert delays.get_title() == "1800 + 500"


def test_the_answer_is_how_many_collisions_each_world_has(runs):
    found = hostile_answer(runs)
    assert found is not None
    assert [label for label, _ in found.items] == ["perfect", "hard"]
    assert "2 (1333: 161 to 4816) by drivers" in found.items[1][1]
    alone = row(0.0, strategy="uncontrolled", automated_vehicles=None)
    assert hostile_answer(runs_of(alone)) is None
