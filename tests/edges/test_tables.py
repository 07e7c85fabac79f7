"""How tables look on a terminal and elsewhere."""

import os
import pty
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.cli.table_text import text_lines
from coramp.cli.table_view import fitted
from coramp.studies.summary import overview
from coramp.studies.tables import Table, is_number
from tests.edges import invoke
from tests.study import overridden, run_row, runs_of

WIDTH = 80
DELAYS = dict.fromkeys(("delay_s", "mainline_delay_s", "ramp_delay_s", "delay_bound_s"), 1234.5)
OVERVIEW = overview(
    runs_of(
        *(
            overridden(run_row(strategy, 1800.0, 500.0, seed, **DELAYS), "safety.time_gap_s=1.0")
            for strategy in ("mainline-priority", "uncontrolled")
            for seed in (1, 2)
        )
    )
)
words = st.text("abcdefgh_.", min_size=1, max_size=14)
numbers = st.sampled_from(
    ["-", "3", "-0.25", "1.57 ± 11.94", "1800 + 500", "inf", "21,401", "3e-09"]
)


@st.composite
def tables(draw):
    kinds = draw(st.lists(st.booleans(), min_size=1, max_size=12))
    column = [numbers if number else st.lists(words, max_size=5).map(" ".join) for number in kinds]
    rows = tuple(
        tuple(draw(cell) for cell in column)
        for _ in range(draw(st.integers(min_value=1, max_value=5)))
    )
    names = tuple(f"{draw(words)} {draw(words)} c{k}" for k in range(len(kinds)))
    return Table("T", names, rows, importance=tuple(draw(st.permutations(names))))


def lines_of(table):
    return text_lines(fitted(table, WIDTH), WIDTH)


@given(table=tables())
def test_every_line_fits_and_no_word_or_number_is_broken(table):
    shown, lines = fitted(table, WIDTH), lines_of(table)
    assert all(len(line) <= WIDTH for line in lines)
    text = "\n".join(lines)
    for cells in zip(*shown.rows, strict=True):
        numeric = all(map(is_number, cells))
        for cell in cells:
            for part in [cell] if numeric else cell.split():
                assert part in text


@given(table=tables())
def test_what_is_left_out_is_named(table):
    shown = fitted(table, WIDTH)
    said = " ".join(shown.notes)
    assert shown.columns
    for name in table.columns:
        assert name in shown.columns or name in said
    assert shown.rows == tuple(
        tuple(row[table.columns.index(name)] for name in shown.columns) for row in table.rows
    )


@given(table=tables())
def test_elsewhere_a_row_is_one_line_with_its_cells(table):
    lines = text_lines(table, None)
    assert len(lines) == 4 + len(table.rows)
    for row, line in zip(table.rows, lines[4:], strict=True):
        assert line.split() == " ".join(row).split()


def test_numbers_stand_to_the_right():
    table = Table("T", ("what", "value"), (("a", "1.5"), ("b", "12.25"), ("c", "-")))
    assert table.numeric == [False, True]
    assert lines_of(table)[4:] == [" a       1.5", " b     12.25", " c         -"]
    assert not is_number("free 2, reach 5")
    assert not is_number("1.2 m")


def test_the_overview_keeps_what_tells_its_rows_apart():
    shown = fitted(OVERVIEW, WIDTH)
    assert shown.columns[0] == "strategy"
    said = " ".join(shown.notes)
    assert "In all rows: setting time gap 1.0 s, flow (veh/h) 1800 + 500, delay" in said
    assert "engine sumo, scenario paper" in said
    assert "delay of all (s) 1234.50 ± 0.00" in said


def test_wide_prints_all_columns_and_help_has_an_example(tmp_path):
    (tmp_path / "s.toml").write_text(
        'name = "s"\nscenario = "paper"\nhorizon_s = 20.0\nseeds = 1\n[[runs]]\n'
        'strategies = ["mainline-priority", "ramp-priority"]\nengine = "exact"\n'
    )
    asked = ("study", tmp_path / "s.toml", "--jobs", "1", "--out", tmp_path / "o")
    narrow, wide = invoke(*asked), invoke(*asked, "--wide")
    assert narrow.code == wide.code == 0
    assert "hardest braking (m/s2)" in wide.out.splitlines()[2]
    assert "hardest braking (m/s2)" not in narrow.out.splitlines()[2]
    assert any(line.startswith("In all rows: ") for line in narrow.out.splitlines())
    for command in ("run", "study", "plan", "explain", "audit"):
        assert "--wide" in invoke(command, "--help").out
    assert "coramp study paper --wide" in invoke("study", "--help").out


def test_every_summary_in_the_help_is_whole():
    commands = invoke("--help").out.split("Commands:")[1]
    assert "figures" in commands
    assert "..." not in commands


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals")
def test_on_a_terminal_of_80_columns_nothing_is_wider():
    mine, theirs = pty.openpty()
    program = "from coramp.cli import main; main(['plan', 'example'])"
    environment = {**os.environ, "COLUMNS": "80", "LINES": "24"}
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=theirs, stderr=subprocess.DEVNULL, env=environment
    ):
        os.close(theirs)
        said = b""
        while True:
            try:
                part = os.read(mine, 65536)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            said += part
    os.close(mine)
    table = said.decode().split("Eq.", 1)[1].split("Checked")[0].splitlines()
    assert len(table) > 30
    assert max(map(len, table)) <= 80
    assert any(line.endswith("12.3514 m") for line in table)
