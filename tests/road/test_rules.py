"""Rules as one array and back."""

import itertools

import numpy as np
import pytest

from coramp.road.rules import Rules, packed, unpacked
from tests.mathematics import FLAGS, RULES, rules_of_numbers


@pytest.mark.parametrize("flags", list(itertools.product((False, True), repeat=FLAGS)))
def test_rules_come_back_with_every_field_in_its_place(flags):
    rules = rules_of_numbers(flags)
    assert unpacked(packed(rules)) == rules


def test_every_number_has_a_place_of_its_own():
    numbers = np.arange(36.0)
    rules = unpacked(numbers)
    assert isinstance(rules, Rules)
    assert [float(value) for part in rules for value in part][:32] == numbers[:32].tolist()
    assert (rules.control.gap_at_front, rules.control.create_from_nose) == (True, True)
    assert rules.traffic == (True, 35.0)
    assert len(packed(RULES)) == 36
