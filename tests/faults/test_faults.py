"""Faults put in by hand are caught: one of each kind here, all of them by ``make faults``."""

import pytest

from tests.faults.catching import SOURCE, catch, usual_refusals
from tests.faults.faults import FAULTS

BY_NAME = {fault.name: fault for fault in FAULTS}


@pytest.mark.parametrize("fault", FAULTS, ids=BY_NAME)
def test_what_a_fault_changes_stands_there_once(fault):
    for edit in fault.edits:
        assert (SOURCE / "coramp" / edit.path).read_text().count(edit.before) == 1, edit


@pytest.mark.parametrize(
    ("name", "by"),
    [
        ("plans begin 3 m ahead of where the vehicle is", "the checker"),
        ("plans 5 mm too near, and violations count only below -0.01 m", "the audit"),
    ],
)
def test_a_fault_is_caught(name, by, tmp_path):
    fault = BY_NAME[name]
    (tmp_path / "clean").mkdir()
    (tmp_path / "faulty").mkdir()
    usual = usual_refusals(fault, tmp_path / "clean")
    assert catch(fault, tmp_path / "faulty", usual).by == by
