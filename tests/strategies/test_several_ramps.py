"""Meters of several ramps, worked by hand: ALINEA at each, and HERO's clusters."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.errors import CorampError
from coramp.scenarios.loading import load_scenario
from coramp.strategies.alinea import Alinea
from coramp.strategies.base import Detectors
from coramp.strategies.hero import Hero
from coramp.strategies.metering import RampSeen

TWO = ((0, 1),)


def fed(strategy, ramps, seconds=5, roads=TWO):
    """The answer after so many seconds of the same samples, and all updates."""
    memory, updates = None, []
    for now_s in range(1, seconds + 1):
        answer = strategy.meter(float(now_s), ramps, roads, memory)
        memory, updates = answer.memory, [*updates, *answer.updates]
    return answer, updates


def ramp(occupancy, queue_veh, arrived_veh=0, room_veh=40.0, at_start=0.0):
    return RampSeen(Detectors(occupancy, at_start, 0), arrived_veh, queue_veh, room_veh)


CLEAR, LONG = ramp(0.05, 0, arrived_veh=1), ramp(0.25, 20)


def test_each_ramp_is_metered_by_itself():
    # at the sixth second 5 s are over: 1200 + 70 (20 - 5) is cut off, 1200 + 70 (20 - 25) is 850
    _, updates = fed(Alinea(update_s=5.0), [CLEAR, LONG], 6)
    assert [u.rate_veh_h for u in updates] == pytest.approx([1200.0, 850.0])
    assert [(u.role, u.master, u.queue_veh) for u in updates] == [("alone", 0, 0), ("alone", 1, 20)]
    assert updates[0].arrivals_veh_h == pytest.approx(6 * 720.0)


def test_a_queue_at_the_start_lets_its_ramp_go_and_no_other():
    full = ramp(0.5, 30, at_start=0.6)
    _, updates = fed(Alinea(update_s=5.0), [LONG, full], 6)
    assert [(u.rate_veh_h, u.let_go) for u in updates] == [
        (pytest.approx(850.0), False),
        (1200.0, True),
    ]


def test_upstream_holds_back_for_a_ramp_whose_queue_grows():
    """Half of the second ramp's room is taken, at 25 % of occupancy: it asks the first for help.

    Together 20 of 80 wait: the first is to have 10 in 5 s, and lets as few pass as it can.
    """
    _, updates = fed(Hero(update_s=5.0), [CLEAR, LONG], 6)
    assert [(u.role, u.master) for u in updates] == [("slave", 1), ("master", 1)]
    assert [u.rate_veh_h for u in updates] == pytest.approx([240.0, 850.0])


def test_a_ramp_of_another_road_is_not_asked():
    _, updates = fed(Hero(update_s=5.0), [CLEAR, LONG], 6, roads=((0,), (1,)))
    assert [(u.role, u.master) for u in updates] == [("alone", 0), ("master", 1)]
    assert [u.rate_veh_h for u in updates] == pytest.approx([1200.0, 850.0])


def test_one_waits_less_for_the_next_green_at_a_higher_rate():
    """At 240 an hour one passes every 15 s."""
    law, memory, passed = Alinea(target_occupancy_percent=1.0, update_s=5.0), None, []
    green = True
    for now_s in range(1, 121):
        went = int(green and now_s > 30)
        seen = RampSeen(Detectors(0.5, 0.0, went), went, 10, 40.0)
        answer = law.meter(float(now_s), [seen], ((0,),), memory)
        memory, (green,) = answer.memory, answer.green
        passed += [now_s] * went
    gaps = [b - a for a, b in zip(passed[-4:], passed[-3:], strict=False)]
    assert gaps == [15, 15, 15]


@given(
    st.lists(
        st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.integers(0, 3)),
        min_size=1,
        max_size=80,
    )
)
def test_one_of_several_is_metered_as_one_alone(told):
    law = Alinea(update_s=10.0)
    memory, state = None, law.start(1.0)
    for k, (occupancy, queue, passed) in enumerate(told):
        now_s, seen = 1.0 + k, Detectors(occupancy, queue, passed)
        state = law.after(state, seen, now_s)
        answer = law.meter(now_s, [RampSeen(seen, 0, 0, 40.0)], ((0,),), memory)
        memory = answer.memory
        assert answer.green == (state.green,)
        assert memory.ramps[0].meter == state


def test_thresholds_that_end_what_they_would_begin_are_refused():
    assert Hero().problems() == []
    assert len(Hero(least_veh_h=1300.0, far_percent=95.0, ends_percent=31.0).problems()) == 3
    with pytest.raises(CorampError, match=r"hero.ends_percent: 40 is above begins_percent; .* 30"):
        load_scenario("paper", {"strategy.hero.ends_percent": 40.0})
