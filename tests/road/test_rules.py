"""Rules as one array and back."""

import numpy as np

from coramp.road.rules import Control, Rules, packed, unpacked
from tests.mathematics import RULES


def test_packing_and_unpacking_gives_the_same_rules():
    for control in (
        Control(0.1, 0.2, 0.5, gap_at_front=True, create_from_nose=False),
        Control(0.1, 0.2, 0.5, gap_at_front=False, create_from_nose=True),
    ):
        rules = RULES._replace(control=control)
        assert unpacked(packed(rules)) == rules


def test_every_number_has_a_place_of_its_own():
    numbers = np.arange(35.0)
    rules = unpacked(numbers)
    assert isinstance(rules, Rules)
    assert [float(value) for part in rules for value in part][:31] == numbers[:31].tolist()
    assert (rules.control.gap_at_front, rules.control.create_from_nose) == (True, True)
    assert rules.traffic == (True, 34.0)
    assert len(packed(RULES)) == 35
