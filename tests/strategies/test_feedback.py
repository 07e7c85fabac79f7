"""Feedback laws: what they settle at, and barriers that hold between samples too."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.checker.record import empty_record
from coramp.coordination.commitments import commit_entry
from coramp.coordination.ledger import Ledger
from coramp.road.lanes import MAINLINE, RAMP
from coramp.road.rules import packed
from coramp.scenarios.loading import load_scenario
from coramp.strategies.feedback import Platoon, place_on_mainline, virtual_platoon
from coramp.strategies.ocbf import Ocbf
from coramp.strategies.virtual_platoon import VirtualPlatoon
from tests.mathematics import sized

RULES = load_scenario("paper").rules()
LENGTH_M = 5.0
D, UP = 2.94, 1.5


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


def on_the_road(*vehicles):
    """The platoon of vehicles ``(stream, station, speed)`` that cruise or, on the ramp, stop."""
    ledger, record = Ledger(), empty_record(16, 128)
    for stream, station_m, speed_mps in vehicles:
        pieces = np.array([[0.0, station_m, speed_mps, 0.0]])
        commit_entry(
            ledger.book, record, sized(LENGTH_M), stream == "r", 0, pieces, 0.0, 20.0, 400.0
        )
    return virtual_platoon(ledger.fleet, 0.0, packed(RULES))


def test_nobody_overtakes_on_the_ramp_however_slow_the_one_ahead():
    # free movement has the one at -60 m 21.6 m before the slow one at -40 m
    platoon = on_the_road(("r", -60.0, 16.0), ("r", -40.0, 6.0), ("m", -90.0, 20.0))
    slow_m, _ = place_on_mainline(-40.0, 6.0, RULES)
    fast_m, _ = place_on_mainline(-60.0, 16.0, RULES)
    assert fast_m > slow_m + 20.0
    assert platoon.station_m.tolist() == [-90.0, -40.0, -60.0]
    assert platoon.same_road.tolist() == [-1, -1, 1]
    assert platoon.virtual_m.tolist() == [-90.0, slow_m, slow_m - LENGTH_M]
    assert platoon.virtual_mps[2] == pytest.approx(6.0 * 20.0 / 16.0)


@pytest.mark.parametrize("law", [VirtualPlatoon(), Ocbf()])
def test_who_comes_up_to_a_slow_one_on_the_ramp_brakes_and_not_the_slow_one(law):
    slow, fast = law.accelerations_mps2(on_the_road(("r", -60.0, 16.0), ("r", -40.0, 6.0)), RULES)
    assert slow > 0.5
    assert fast < -2.0


def test_both_streams_are_sorted_into_one():
    platoon = on_the_road(
        ("m", -200.0, 20.0), ("r", -160.0, 16.0), ("m", -210.0, 20.0), ("m", 10.0, 20.0)
    )
    assert platoon.station_m.tolist() == [10.0, -200.0, -160.0, -210.0]
    assert platoon.same_road.tolist() == [-1, 0, -1, 1]
    assert platoon.stage.tolist() == [MAINLINE, MAINLINE, RAMP, MAINLINE]


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


@pytest.mark.parametrize("front_mps", [19.0, 19.5])
def test_a_ramp_vehicle_follows_one_on_the_mainline_as_if_it_were_there(front_mps):
    law = VirtualPlatoon()
    # at -160 m its place is -204 m, 12.5 m behind the other's tail at -191.5 m, at 20 m/s
    beside = two(-31.5, front_mps, 16.0, -160.0, (MAINLINE, RAMP))
    expected = 0.25 * (12.5 - 0.6 * 20.0 - 1.0) + 0.8 * (front_mps - 20.0)
    u = law.accelerations_mps2(beside, RULES)[1]
    assert -2.94 < u < -0.1
    assert u == pytest.approx(expected * 16.0 / 20.0)


def barriers_m(law, gap_m, front_mps, rear_mps):
    """b, and b less the difference of the distances to stop in."""
    b = gap_m - law.headway_s * rear_mps - law.standstill_gap_m
    return b, b - (rear_mps**2 - front_mps**2) / (2.0 * D)


def moved(mps, accel_mps2, t):
    """Way and speed after t of one who stops at a stand."""
    if accel_mps2 < 0.0 and mps + accel_mps2 * t < 0.0:
        return mps * mps / (-2.0 * accel_mps2), 0.0
    return mps * t + 0.5 * accel_mps2 * t * t, mps + accel_mps2 * t


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.floats(-D, UP), min_size=40, max_size=40),
    st.floats(0.0, 20.0),
    st.floats(0.0, 20.0),
    st.sampled_from([0.0, 0.01, 0.5, 5.0, 40.0]),
    st.sampled_from([(0.1, 2.0), (0.5, 1.0), (0.5, 2.0), (1.0, 1.0), (1.0, 0.3)]),
    st.sampled_from([0.125, 0.3, 0.5, 1.5]),
)
def test_the_barrier_is_never_broken(wishes, front, rear, spare_m, clock, phi_s):
    """Whatever the leader does within its bounds, and however it changes its mind at samples.

    The rear vehicle takes all that its barriers allow, from wherever both barriers hold.
    """
    period_s, rate = clock
    law = Ocbf(period_s=period_s, headway_s=phi_s, barrier_rate_ps=rate)
    assert law.problems() == []
    gap_m = law.standstill_gap_m + phi_s * rear + spare_m
    gap_m += max(0.0, rear**2 - front**2) / (2.0 * D)
    for wish in wishes:
        platoon = two(gap_m, front, rear)
        lead = min(wish, rate * (20.0 - front))
        allowed = law.highest_mps2(
            law.barriers(platoon, RULES), 1, np.array([lead, 0.0]), RULES, stopping=True
        )
        lowest, highest = law.bounds_mps2(platoon, RULES)
        u = max(lowest, min(highest[1], allowed))
        for share in np.linspace(0.0, 1.0, 21):
            (ahead_m, ahead_mps), (own_m, own_mps) = (
                moved(*one, share * period_s) for one in ((front, lead), (rear, u))
            )
            b, _ = barriers_m(law, gap_m + ahead_m - own_m, ahead_mps, own_mps)
            assert b >= -1e-6
        gap_m, front, rear = gap_m + ahead_m - own_m, ahead_mps, own_mps


def test_the_law_takes_no_more_than_its_barriers_allow():
    law = Ocbf()
    platoon = two(11.0, 15.0, 17.0)
    accel = law.accelerations_mps2(platoon, RULES)
    allowed = law.highest_mps2(law.barriers(platoon, RULES), 1, accel, RULES, stopping=True)
    assert -D < allowed < 0.0
    assert accel[1] == pytest.approx(allowed)


def test_without_the_distance_to_stop_in_the_barrier_breaks():
    """15.5 m behind one at 16 m/s who brakes as hard as it can, oneself at 20 m/s."""

    def least_m(stopping):
        law, gap_m, front, rear, least = Ocbf(), 15.5, 16.0, 20.0, np.inf
        for _ in range(8):
            platoon, lead = two(gap_m, front, rear), np.array([-D, 0.0])
            u = law.highest_mps2(law.barriers(platoon, RULES), 1, lead, RULES, stopping=stopping)
            (ahead_m, front), (own_m, rear) = moved(front, -D, 0.5), moved(rear, max(-D, u), 0.5)
            gap_m += ahead_m - own_m
            least = min(least, barriers_m(law, gap_m, front, rear)[0])
        return least

    assert least_m(stopping=False) < -1.0
    # b_s is below 0 from the start here: nothing could keep b, but braking at once keeps more of it
    assert least_m(stopping=True) > least_m(stopping=False) + 0.2


def test_without_the_margin_for_the_period_the_barrier_breaks():
    """At the edge of the barrier the margin is what keeps it between two samples."""
    law, v, t = Ocbf(), 15.0, 0.5
    gap_m = law.headway_s * v + law.standstill_gap_m  # b = 0
    lead, unmargined = -1.0, 0.0

    def after_m(u):
        return barriers_m(law, gap_m + 0.5 * (lead - u) * t * t, v + lead * t, v + u * t)[0]

    assert after_m(unmargined) < 0.0
    allowed = law.highest_mps2(
        law.barriers(two(gap_m, v, v), RULES), 1, np.array([lead, 0.0]), RULES, stopping=True
    )
    assert after_m(allowed) >= -1e-9


@settings(max_examples=300, deadline=None)
@given(
    st.floats(-390.0, -40.0),
    st.floats(14.0, 20.0),
    st.floats(0.0, 20.0),
    st.floats(-D, UP),
    st.sampled_from([0.5, 1.0]),
)
def test_the_merge_barrier_holds_until_the_next_sample(ramp_m, front_mps, spare_m, lead, period_s):
    """A ramp vehicle at v_R0, whose place is exact, behind one on the mainline."""
    law = Ocbf(period_s=period_s, headway_s=1.0)
    place_m, _ = place_on_mainline(ramp_m, 16.0, RULES)
    phi_s = law.headway_s * np.clip(1.0 + place_m / 400.0, 0.05, 1.0)
    gap_m = law.standstill_gap_m + phi_s * 20.0 + spare_m
    front_m = place_m + LENGTH_M + gap_m
    platoon = two(front_m - LENGTH_M - ramp_m, front_mps, 16.0, ramp_m, (MAINLINE, RAMP))
    barriers = law.merge_barriers(platoon, RULES)
    allowed = law.highest_mps2(barriers, 1, np.array([lead, 0.0]), RULES, stopping=False)
    if allowed < -D:
        return  # more than the brakes can do: the supervisor's business
    u = min(allowed, UP) * 20.0 / 16.0
    for t in np.linspace(0.0, period_s, 21):
        ahead_m = front_mps * t + 0.5 * lead * t * t
        own_m, own_mps = 20.0 * t + 0.5 * u * t * t, 20.0 + u * t
        phi_then = law.headway_s * np.clip(1.0 + (place_m + own_m) / 400.0, 0.05, 1.0)
        b = gap_m + ahead_m - own_m - phi_then * own_mps - law.standstill_gap_m
        assert b >= -1e-6


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            {"barrier_rate_ps": 2.0, "period_s": 1.0},
            "barrier_rate_ps: 2 is too much for period_s 1",
        ),
        ({"headway_s": 0.06}, "headway_s: 0.06 is too short for period_s 0.5; allowed is 0.0625"),
    ],
)
def test_what_the_proof_needs_is_asked_for(settings, told):
    assert any(line.startswith(told) for line in Ocbf(**settings).problems())


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
