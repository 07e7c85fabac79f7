"""Numbers stay: every kept row is what it was, but for rounding."""

import pytest

from tests.kept_rows.rows import ROUNDING, differences, kept_rows, row_of
from tests.kept_rows.specs import kept_runs

RUNS, KEPT = kept_runs(), kept_rows()["rows"]
SLICES = 6


def test_every_run_has_its_kept_row():
    assert len(RUNS) == len(KEPT) >= 200
    assert sum("safety.time_gap_s" in run.options.get("overrides", {}) for run in RUNS) >= 40


@pytest.mark.parametrize("offset", range(SLICES))
def test_rows_are_what_they_were(offset):
    changed = []
    for run, before in list(zip(RUNS, KEPT, strict=True))[offset::SLICES]:
        if lines := differences(before, row_of(run), ROUNDING):
            changed.append((run, lines))
    assert not changed


def test_a_changed_figure_is_seen():
    row = next(row for row in KEPT if row.get("mainline_delay_s"))
    other = {**row, "mainline_delay_s": row["mainline_delay_s"] + 1e-6}
    assert differences(row, other, ROUNDING)
    assert not differences(row, dict(row), 0.0)
