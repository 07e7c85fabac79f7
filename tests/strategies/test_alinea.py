"""ALINEA: its law by hand, its set point, its signal."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.coordination.ledger import Ledger
from coramp.errors import CorampError
from coramp.road.rules import packed
from coramp.scenarios.loading import load_scenario
from coramp.strategies.alinea import Alinea
from coramp.strategies.base import Detectors, SetRampSignal, View

RULES = load_scenario("paper").rules()


def view(time_s, occupancy=0.0, queue=0.0, passed=0):
    fleet = Ledger().fleet
    return View(
        time_s,
        (),
        fleet,
        fleet,
        lambda: None,
        20.0,
        RULES,
        packed(RULES),
        Detectors(occupancy, queue, passed),
    )


def driven(law, occupancy, seconds, queue=0.0, waiting=True):
    """Runs the law; whoever waits passes a second after green. Returns memory, and the passed."""
    memory, green, passed, total = None, True, 0, []
    for second in range(1, seconds + 1):
        decision = law.decide(view(float(second), occupancy(second, memory), queue, passed), memory)
        memory = decision.memory
        for command in decision.commands:
            assert isinstance(command, SetRampSignal)
            assert command.green != green
            green = command.green
        passed = int(green and waiting)
        total += [second] * passed
    return memory, total


def test_the_law_by_hand():
    law = Alinea(target_occupancy_percent=20.0, gain_veh_h=70.0)
    assert law.next_rate_veh_h(600.0, 23.0) == pytest.approx(390.0)
    assert law.next_rate_veh_h(600.0, 17.5) == pytest.approx(775.0)
    assert law.next_rate_veh_h(600.0, 60.0) == 240.0
    assert law.next_rate_veh_h(600.0, 0.0) == 1200.0


def test_it_holds_its_set_point():
    """A road whose occupancy grows with the metered flow settles at the target."""
    law = Alinea(target_occupancy_percent=18.0)

    def road(_, memory):
        rate = 1200.0 if memory is None else memory.rate_veh_h
        return (8.0 + 0.015 * rate) / 100.0

    memory, passed = driven(law, road, 3600)
    assert 100.0 * road(0, memory) == pytest.approx(18.0, abs=0.01)
    assert memory.rate_veh_h == pytest.approx((18.0 - 8.0) / 0.015, abs=1.0)
    last_hour_half = [second for second in passed if second > 1800]
    assert len(last_hour_half) * 2.0 == pytest.approx(memory.rate_veh_h, rel=0.08)


def test_a_clear_road_is_not_metered():
    memory, _ = driven(Alinea(), lambda *_: 0.05, 600)
    assert memory.green
    assert memory.rate_veh_h == 1200.0


def test_a_full_ramp_is_let_go():
    full = driven(Alinea(), lambda *_: 0.5, 600, queue=0.8)[0]
    assert full.rate_veh_h == 1200.0
    assert driven(Alinea(), lambda *_: 0.5, 600, queue=0.3)[0].rate_veh_h == 240.0


def test_one_vehicle_a_green():
    _, passed = driven(Alinea(), lambda *_: 0.5, 1200)
    gaps = np.diff([second for second in passed if second > 300])
    assert gaps.mean() == pytest.approx(15.0, abs=0.5)  # 240 an hour
    assert gaps.min() >= 14


def test_green_waits_for_somebody():
    memory, _ = driven(Alinea(), lambda *_: 0.5, 600, waiting=False)
    assert memory.green


@given(
    st.lists(
        st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.integers(0, 3)),
        min_size=1,
        max_size=200,
    )
)
def test_whatever_the_loops_tell_the_rate_is_within_its_bounds_and_the_answer_the_same(told):
    law, memory, green = Alinea(update_s=5.0), None, True
    for second, one in enumerate(told, 1):
        seen = view(float(second), *one)
        decision = law.decide(seen, memory)
        assert law.decide(seen, memory) == decision
        memory = decision.memory
        assert 240.0 <= memory.rate_veh_h <= 1200.0
        for command in decision.commands:
            assert command.green != green
            green = command.green
        assert memory.green == green


def test_rates_that_leave_nothing_to_meter_are_refused():
    assert Alinea().problems() == []
    (told,) = Alinea(least_veh_h=1300.0).problems()
    assert told == "least_veh_h: 1300 meters nothing; allowed is below most_veh_h, 1200"
    with pytest.raises(CorampError, match=r"strategy.alinea.least_veh_h: 1300 meters nothing"):
        load_scenario("paper", {"strategy.alinea.least_veh_h": 1300.0})


def test_decisions_depend_on_the_memory_alone():
    law = dataclasses.replace(Alinea())
    first = law.decide(view(1.0, 0.3), None)
    assert law.decide(view(1.0, 0.3), None) == first
    assert hash(first.memory) == hash(law.decide(view(1.0, 0.3), None).memory)
