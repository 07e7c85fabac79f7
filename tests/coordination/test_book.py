"""Long runs: a book forgets what was committed and never driven, and nothing else."""

import pytest

from coramp.coordination import book as books
from coramp.runs.running import execute, make_spec


def run_of(strategy, horizon_s=120):
    settings = {"control.actuation_delay_s": 0.5}
    spec = make_spec(
        "paper",
        strategy,
        engine="exact",
        mainline_veh_h=1500,
        ramp_veh_h=500,
        horizon_s=horizon_s,
        overrides=settings,
    )
    return execute(spec)


@pytest.mark.parametrize("strategy", ["virtual-platoon", "slots"])
def test_a_book_that_forgets_gives_the_same_run(monkeypatch, strategy):
    whole, row = run_of(strategy)
    copies = []

    def counted(book, out, copy=books._copy_driven):
        copy(book, out)
        copies.append((int(book.used[books.PIECES]), int(out.used[books.PIECES])))

    monkeypatch.setattr(books, "LONG", 16)
    monkeypatch.setattr(books, "_copy_driven", counted)
    again, row_again = run_of(strategy)
    assert any(after < before for before, after in copies)
    for name, frame in whole.frames().items():
        assert frame.equals(again.frames()[name]), name
    assert {**row, **dict.fromkeys(TIMES)} == {**row_again, **dict.fromkeys(TIMES)}


TIMES = ("wall_s", "planning_median_s", "planning_p95_s")


def test_a_book_holds_little_more_than_what_is_driven(monkeypatch):
    sizes = []

    def watched(book, commitments=1, with_room=books.with_room):
        larger = with_room(book, commitments)
        sizes.append(len(larger.pieces))
        return larger

    monkeypatch.setattr(books, "LONG", 2000)
    monkeypatch.setattr("coramp.coordination.ledger.with_room", watched)
    tables, _ = run_of("virtual-platoon", horizon_s=600)
    driven = len(tables.outcome.pieces.rows)
    assert driven > 10_000
    assert sizes[-1] < 4 * driven
