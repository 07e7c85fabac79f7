"""Faults put in by hand are caught: one of each kind here, all of them by ``make faults``."""

import pytest

from tests.faults.catching import catch, usual_refusals
from tests.faults.faults import FAULTS

BY_NAME = {fault.name: fault for fault in FAULTS}


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
