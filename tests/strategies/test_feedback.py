"""Feedback laws: what they settle at, and barriers that hold between samples too."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.loading import load_scenario
from coramp.strategies.feedback import MAINLINE, RAMP, Platoon, place_on_mainline
from coramp.strategies.ocbf import Ocbf
from coramp.strategies.virtual_platoon import VirtualPlatoon

RULES = load_scenario("paper").rules()
LENGTH_M = 5.0


def two(gap_m, front_mps, rear_mps, rear_m=-200.0, stages=(MAINLINE, MAINLINE)):
    """A platoon of two, with a bumper distance, on one road or on two."""
    x = np.array([rear_m + LENGTH_M + gap_m, rear_m])
    v = np.array([front_mps, rear_mps])
    same = np.array([-1, 0 if stages[0] == stages[1] else -1])
    places = [
        place_on_mainline(m, s, RULES) if stage == RAMP else (m, s)
        for m, s, stage in zip(x, v, stages, strict=True)
    ]
    virtual_m, virtual_mps = map(np.array, zip(*places, strict=True))
    length = np.full(2, LENGTH_M)
    return Platoon(np.arange(2), np.array(stages), x, v, length, virtual_m, virtual_mps, same)


def test_a_place_on_the_mainline_by_hand():
    # 160 m at 16 m/s are 10 s; free movement then loses (20 - 16)^2 / (2 x 2) = 4 m
    assert place_on_mainline(-160.0, 16.0, RULES) == (pytest.approx(-204.0), pytest.approx(20.0))
    # from a stand: 85.33 m up to 16 m/s in 10.667 s, 74.67 m in 4.667 s
    assert place_on_mainline(-160.0, 0.0, RULES)[0] == pytest.approx(-20.0 * (32 / 3 + 14 / 3) - 4)
    assert place_on_mainline(10.0, 18.0, RULES)[0] == pytest.approx(10.0 - 1.0)


def test_the_virtual_platoon_by_hand():
    law = VirtualPlatoon(time_gap_s=1.0, standstill_gap_m=2.0, gap_gain_ps2=0.2, speed_gain_ps=0.5)
    # 20 m to one at 18 m/s: 0.2 (20 - 16 - 2) + 0.5 (18 - 16) = 1.4, below 0.5 (20 - 16)
    assert law.accelerations_mps2(two(20.0, 18.0, 16.0), RULES)[1] == pytest.approx(1.4)
    # nobody near: towards v0, at most 1.5 m/s2
    assert law.accelerations_mps2(two(150.0, 20.0, 16.0), RULES)[1] == pytest.approx(1.5)
    assert law.accelerations_mps2(two(2.0, 20.0, 20.0), RULES)[1] == pytest.approx(-2.94)


@pytest.mark.parametrize("front_mps", [8.0, 14.0, 19.0])
def test_the_virtual_platoon_settles_at_its_time_gap(front_mps):
    law, gap_m, v = VirtualPlatoon(), 60.0, 12.0
    for _ in range(400):
        u = law.accelerations_mps2(two(gap_m, front_mps, v), RULES)[1]
        gap_m += (front_mps - v) * law.period_s - 0.5 * u * law.period_s**2
        v += u * law.period_s
    assert v == pytest.approx(front_mps, abs=1e-3)
    assert gap_m == pytest.approx(law.time_gap_s * front_mps + law.standstill_gap_m, abs=0.05)


def test_a_ramp_vehicle_follows_one_on_the_mainline_as_if_it_were_there():
    law = VirtualPlatoon()
    beside = two(0.0, 20.0, 16.0, -160.0, (MAINLINE, RAMP))
    gap_m = beside.virtual_m[0] - LENGTH_M - beside.virtual_m[1]
    on_mainline = two(gap_m, 20.0, 20.0)
    expected = law.accelerations_mps2(on_mainline, RULES)[1] * 16.0 / 20.0
    assert law.accelerations_mps2(beside, RULES)[1] == pytest.approx(expected)


def barrier_m(law, gap_m, rear_mps):
    return gap_m - law.headway_s * rear_mps - law.standstill_gap_m


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(-2.94, 1.5), min_size=40, max_size=40),
    st.floats(8.0, 20.0),
    st.floats(0.0, 30.0),
    st.sampled_from([0.1, 0.5, 1.0]),
    st.sampled_from([0.3, 0.5, 1.5]),
)
def test_the_barrier_is_never_broken_between_samples(wishes, rear_mps, spare_m, period_s, phi_s):
    """The leader does what it likes within its bounds, changing its mind at any sample."""
    law = Ocbf(period_s=period_s, headway_s=phi_s, barrier_rate_ps=1.0)
    gap_m = phi_s * rear_mps + law.standstill_gap_m + spare_m
    front, rear = rear_mps, rear_mps
    for wish in wishes:
        limits = law.limits(two(gap_m, front, rear), RULES)
        if limits.highest_mps2[1] <= limits.lowest_mps2[1]:
            return  # no acceleration within bounds: then the supervisor takes over
        u = law.accelerations_mps2(two(gap_m, front, rear), RULES)[1]
        lead = max(wish, -front / period_s)
        lead = min(lead, (20.0 - front) / period_s)
        for share in np.linspace(0.0, 1.0, 21):
            t = share * period_s
            gap_then = gap_m + (front - rear) * t + 0.5 * (lead - u) * t * t
            assert barrier_m(law, gap_then, rear + u * t) >= -1e-5
        gap_m += (front - rear) * period_s + 0.5 * (lead - u) * period_s**2
        front, rear = front + lead * period_s, rear + u * period_s


def test_without_the_margin_for_the_period_the_barrier_breaks():
    """The margin is needed: at the edge of the barrier, a leader that brakes breaks it without."""
    law = Ocbf(period_s=0.5)
    v = 15.0
    gap_m = law.headway_s * v + law.standstill_gap_m  # b = 0
    unmargined = (0.0 + law.barrier_rate_ps * 0.0) / law.headway_s
    t = law.period_s
    gap_then = gap_m + 0.5 * (-2.94 - unmargined) * t * t
    assert barrier_m(law, gap_then, v + unmargined * t) < 0.0
    allowed = law.limits(two(gap_m, v, v), RULES).highest_mps2[1]
    gap_then = gap_m + 0.5 * (-2.94 - allowed) * t * t
    assert barrier_m(law, gap_then, v + allowed * t) >= -1e-9


def test_the_reference_is_the_unconstrained_optimum():
    law, wish = Ocbf(time_weight=0.25), np.array([20.0])
    one = Platoon(*(np.array([x]) for x in (0, MAINLINE, -300.0, 14.0, 5.0, -300.0, 14.0, -1)))
    beta = 0.5 * 0.25 * 2.94**2 / 0.75
    times = np.linspace(10.0, 300.0 / 14.0, 200001)
    costs = beta * times + 1.5 * (300.0 - 14.0 * times) ** 2 / times**3
    best = times[np.argmin(costs)]
    expected = 3.0 * (300.0 - 14.0 * best) / best**2
    assert law.reference_mps2(one, wish, RULES)[0] == pytest.approx(min(expected, 1.5), abs=1e-3)


def test_the_program_gives_the_reference_where_nothing_binds():
    law = Ocbf(relaxation_weight=1e-6)
    far = two(200.0, 20.0, 14.0, -390.0)
    wish = np.full(2, 20.0)
    reference = law.reference_mps2(far, wish, RULES)
    assert law.accelerations_mps2(far, RULES)[1] == pytest.approx(reference[1], abs=1e-2)
