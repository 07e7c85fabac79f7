"""The figure of the study of shares, and the answer of its report, from rows made by hand."""

import pytest

from coramp.report.page.study_answer import penetration_answer
from coramp.report.penetration_figure import penetration_figure
from tests.study import runs_of
from tests.study.test_penetration_layout import WITHOUT, by_seed, row

ALONE = {"delay_s": 3.0, "hard_brakings_3": 6}


@pytest.fixture(scope="module")
def runs():
    own = by_seed((5.0, 15.1), 0.5, "mixed-slots", hard_brakings_3=1, automated_delay_s=2.0)
    rows = [*WITHOUT, *own, row(1.0, "mixed-slots", delay_s=0.5), row(0.5, **ALONE)]
    return runs_of(*rows, row(0.5, gap_s=1.0, **ALONE))


def lines_of(axes):
    """Returns each labelled line's points."""
    return {
        container.get_label(): list(zip(*container.lines[0].get_data(), strict=True))
        for container in axes.containers
    }


def test_delay_is_drawn_over_the_share_with_kinds_apart_beside_automation_alone(runs):
    delays, _ = penetration_figure(runs).axes
    assert delays.get_title() == "1800 + 500 veh/h\nfair drivers, 0.5 s"
    found = lines_of(delays)
    assert found == {
        "mixed slots": [(0.0, 15.0), (50.0, pytest.approx(10.05)), (100.0, 0.5)],
        "mixed slots: drivers among them": [(50.0, pytest.approx(10.05))],
        "mixed slots: automated vehicles among them": [(50.0, 2.0)],
        "automation alone, yielding": [(0.0, 15.0), (50.0, 3.0)],
    }


def test_brakings_are_counted_per_thousand_vehicles(runs):
    _, brakings = penetration_figure(runs).axes
    found = lines_of(brakings)
    assert found["mixed slots"][:2] == [(0.0, 1000.0), (50.0, 100.0)]
    assert found["automation alone, yielding"] == [(0.0, 1000.0), (50.0, 600.0)]


def test_of_many_demands_those_with_most_shares_are_drawn():
    rows = []
    for flow in range(1000, 1700, 100):
        shares = (0.5,) if flow == 1300 else (0.2, 0.5)
        of_flow = [row(0.0), *(row(share) for share in shares)]
        rows += [{**r, "mainline_veh_h": float(flow)} for r in of_flow]
    axes = penetration_figure(runs_of(*rows)).axes
    titles = [a.get_title().split(" ")[0] for a in axes[: len(axes) // 2]]
    assert titles == ["1000", "1100", "1200", "1400", "1500"]


def test_the_answer_is_from_which_share_it_pays(runs):
    found = penetration_answer(runs)
    assert found is not None
    (item,) = found.items
    assert item[0] == "1800 + 500 veh/h, fair drivers, mixed-slots at 0.5 s"
    assert item[1].startswith("less delay for all ")
    assert penetration_answer(runs_of(*WITHOUT)) is None
