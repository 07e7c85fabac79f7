"""One writer of commitments: ledger and checker never know of different ones."""

from pathlib import Path

import numpy as np
import pytest

import coramp
from coramp.checker.record import LIVE, forget_exited, way_of
from coramp.coordination.book import empty_book, strike_exited
from coramp.coordination.coordinator import Coordinator
from coramp.demand.arrivals import arrivals_of
from coramp.messages.feed import RequestFeed
from coramp.scenarios.loading import load_scenario
from coramp.strategies.registry import strategy_named

SCENARIO = load_scenario(
    "paper",
    {
        "mainline.flow_veh_h": 1800.0,
        "ramp.flow_veh_h": 600.0,
        "simulation.horizon_s": 60.0,
        "control.actuation_delay_s": 0.3,
    },
)
LAST_STEP = 600
WRITERS = ("write_commitment(", "note_entry(", "note_command(")
"""Kernels that only ``commitments`` may call, and where they stand."""
PLACES = {"coordination/commitments.py", "coordination/book.py", "checker/record.py"}


def after_a_minute(name):
    loop = Coordinator(
        strategy_named(name)(),
        SCENARIO.rules(),
        RequestFeed(arrivals_of(SCENARIO, 5)),
        SCENARIO.fastest_mainline_entry_mps,
    )
    loop.ledger.book = empty_book(1, 1, 16)  # so that it must grow, and the record must not
    loop.expect_arrivals()
    loop.run(LAST_STEP)
    return loop


@pytest.mark.parametrize("name", ["mainline-priority", "virtual-platoon"])
def test_ledger_and_checker_hold_the_same_commitments(name):
    loop = after_a_minute(name)
    book, record = loop.ledger.book, loop._commitments.examiner.record
    strike_exited(book, LAST_STEP * 0.1)
    forget_exited(record, LAST_STEP * 0.1)
    on_road = loop.ledger.fleet.live.tolist()
    assert len(on_road) > 20
    assert record.live[: record.used[LIVE]].tolist() == on_road
    for row in on_road:
        told = way_of(record, row)
        assert told.merge_s == loop.ledger.merge_time_s(row)
        np.testing.assert_array_equal(told.pieces, loop.ledger.way(row))


def test_nobody_else_writes_commitments():
    package = Path(coramp.__file__).parent
    calls = [
        f"{path.relative_to(package)}: {line.strip()}"
        for path in sorted(package.rglob("*.py"))
        if path.relative_to(package).as_posix() not in PLACES
        for line in path.read_text().splitlines()
        if any(writer in line for writer in WRITERS)
    ]
    assert calls == []
