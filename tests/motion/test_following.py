"""Following a slower vehicle: speeding up within one's power, and braking as late as is safe."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from coramp.kinematics.trajectory import ACCEL, MAX_PIECES, SPEED, STATION, TIME, begin
from coramp.motion.following import Leader, follow, follow_safely, speed_up
from tests.mathematics import (
    RULES,
    close,
    pieces,
    sampled,
    sampled_own_margins,
    sized,
    truck,
)

STREAM = -math.inf
ALLOWANCE_M = 0.1
END_M = RULES.road.mainline_end_m


def sped_up(start_mps, target_mps, most_mps2, traits):
    out = np.empty((MAX_PIECES, 4))
    n = begin(out, 2.0, -50.0, start_mps)
    return out[: speed_up(out, n, target_mps, most_mps2, traits)]


def following(base, leader, traits=None, leader_traits=None, **more):
    """The way that is chosen behind a leader; empty where there is none."""
    asked = {"merge_s": STREAM, "from_s": -math.inf, "leader_s": STREAM, "dip_mps": 0.0, **more}
    out = np.empty((MAX_PIECES, 4))
    n = follow_safely(
        base,
        asked["merge_s"],
        asked["from_s"],
        Leader(leader, sized() if leader_traits is None else leader_traits, asked["leader_s"]),
        sized() if traits is None else traits,
        asked["dip_mps"],
        RULES,
        out,
    )
    return out[:n]


def joined(way):
    """Whether pieces join in station and speed."""
    dt = np.diff(way[:, TIME])
    v, a = way[:-1, SPEED], way[:-1, ACCEL]
    ends_m = way[:-1, STATION] + (v + a * dt / 2.0) * dt
    return bool(
        (dt > 0.0).all()
        and np.allclose(ends_m, way[1:, STATION], rtol=0.0, atol=1e-7)
        and np.allclose(v + a * dt, way[1:, SPEED], rtol=0.0, atol=1e-7)
    )


# speeding up --------------------------------------------------------------------------------


def test_a_truck_speeds_up_in_bands_by_hand():
    # 16 to 20 m/s in three bands, each with 5.5 W/kg over the speed at its end
    way = sped_up(16.0, 20.0, 2.0, truck())
    ends = [16.0 + 4.0 / 3.0, 16.0 + 8.0 / 3.0, 20.0]
    assert way[:, ACCEL].tolist() == [*(close(5.5 / v) for v in ends), 0.0]
    assert way[:, SPEED].tolist() == [16.0, *(close(v) for v in ends)]
    assert joined(way)


def test_one_constant_rate_is_enough_where_power_does_not_bind():
    assert sped_up(2.0, 5.0, 2.0, truck())[:, ACCEL].tolist() == [1.0, 0.0]
    assert sped_up(16.0, 20.0, 0.2, truck())[:, ACCEL].tolist() == [0.2, 0.0]
    assert sped_up(16.0, 20.0, 2.0, sized())[:, ACCEL].tolist() == [2.0, 0.0]


def test_who_is_as_fast_already_stays():
    assert len(sped_up(20.0, 20.0, 2.0, truck())) == len(sped_up(22.0, 20.0, 2.0, truck())) == 1


@given(
    start_mps=st.floats(0.0, 35.0),
    more_mps=st.floats(0.01, 35.0),
    most_mps2=st.floats(0.2, 6.0),
    own_mps2=st.one_of(st.just(math.inf), st.floats(0.1, 10.0)),
    power_wpkg=st.one_of(st.just(math.inf), st.floats(0.5, 100.0)),
)
@example(0.0, 35.0, 6.0, 10.0, 0.5)
def test_nobody_accelerates_harder_than_it_can_at_any_moment(
    start_mps, more_mps, most_mps2, own_mps2, power_wpkg
):
    traits = truck(acceleration_mps2=own_mps2, power_wpkg=power_wpkg)
    target_mps = start_mps + more_mps
    way = sped_up(start_mps, target_mps, most_mps2, traits)
    assert joined(way)
    assert way[-1, SPEED:].tolist() == [close(target_mps), 0.0]
    accels = way[:-1, ACCEL, None]
    starts, ends = way[:-1, SPEED, None], way[1:, SPEED, None]
    speeds = starts + (ends - starts) * np.linspace(0.0, 1.0, 50)
    able = np.minimum(own_mps2, power_wpkg / np.maximum(speeds, 1e-12))
    assert (accels > 0.0).all()
    assert (accels <= np.minimum(able, most_mps2) * (1.0 + 1e-9)).all()


def test_bands_lose_little_against_full_power():
    # at full power (v^3 - v_0^3) / (3 P) metres; bands of 1.5 m/s take some more
    way = sped_up(16.0, 24.0, 2.0, truck())
    needed_m = (24.0**3 - 16.0**3) / (3.0 * 5.5)
    assert needed_m < way[-1, STATION] + 50.0 < 1.08 * needed_m


# following ----------------------------------------------------------------------------------


def test_who_comes_up_to_a_slower_one_brakes_at_the_last_safe_step_by_hand():
    # 95 m between bumpers, 10 m/s faster: braking by 2 m/s2 takes 25 m of it, 0.04 m and the
    # allowance are to be left: (95 - 25 - 0.14) / 10 = 6.986 s
    base, leader = pieces(0.0, -200.0, 20.0), pieces(0.0, -100.0, 10.0)
    expected = [[0.0, -200.0, 20.0, 0.0], [6.9, -62.0, 20.0, -2.0], [11.9, 13.0, 10.0, 0.0]]
    assert following(base, leader) == close(np.array(expected))


def test_the_followers_time_gap_has_it_brake_earlier_by_hand():
    # the gap of 1 s is worth 10 m at the leader's speed, and at dv more, dv^2 / 4 m before, the
    # margin is dv^2 (0.25 - 0.10005) - dv less: 1.667 m at most; (70 - 0.14 - 11.667) / 10
    base, leader = pieces(0.0, -200.0, 20.0), pieces(0.0, -100.0, 10.0)
    way = following(base, leader, sized(time_gap_s=1.0), sized(time_gap_s=9.0))
    assert way[1, TIME] == close(5.8)


def test_a_long_leader_and_its_errors_count():
    base, leader = pieces(0.0, -200.0, 20.0), pieces(0.0, -100.0, 10.0)
    # 11.5 m longer and 1.98 m of its own error
    way = following(base, leader, sized(), truck(positioning_error_m=2.0))
    assert way[1, TIME] == close(5.6)  # (95 - 25 - 0.14 - 11.5 - 1.98) / 10 = 5.638


def test_nobody_brakes_who_need_not():
    base, leader = pieces(0.0, -300.0, 20.0), pieces(0.0, 0.0, 19.0)
    # the leader leaves the zone after 400 / 19 s: only 21 m of 295 m are gone by then
    assert following(base, leader).tolist() == base.tolist()


def test_nobody_follows_who_cannot_stop_in_time():
    # 20 m between bumpers, of which braking takes 25 m
    assert len(following(pieces(0.0, -125.0, 20.0), pieces(0.0, -100.0, 10.0))) == 0


def test_before_a_merge_it_opens_the_gap_by_the_least_dip_by_hand():
    # the leader merges at 10 s, 3 m ahead: 5 m of length, Eq. 16 and the allowance less 3 m are
    # to be lost, of which a dip of D loses D^2 / 2 (1 / 2 + 1 / 1.5)
    leader = pieces(0.0, -154.0, 16.0, [(16.0, 8.0), (20.0, 2.0)])  # at 10 m at 10 s
    base = pieces(0.0, -193.0, 20.0)
    missing_m = 5.0 + 0.7583002436540073 + 0.1 - 3.0
    least_mps = math.sqrt(missing_m / (0.5 * (1.0 / 2.0 + 1.0 / 1.5)))
    assert 2.125 < least_mps < 2.25  # 18 of 32 steps of 4 m/s
    way = following(base, leader, leader_s=10.0, dip_mps=4.0)
    assert way[:3, ACCEL].tolist() == [-2.0, close(1.5), 0.0]
    assert way[2:, SPEED] == close(20.0)
    assert way[1, SPEED] == close(20.0 - 2.25)
    assert len(following(base, leader, leader_s=10.0, dip_mps=2.0)) == 0


def test_one_with_weak_brakes_brakes_by_what_it_can():
    # 10 m/s less by 1 m/s2 takes 50 m: (95 - 50 - 0.14) / 10 = 4.486 s
    base, leader = pieces(0.0, -200.0, 20.0), pieces(0.0, -100.0, 10.0)
    way = following(base, leader, truck(braking_mps2=1.0))
    assert way[1].tolist() == close([4.4, -112.0, 20.0, -1.0])
    assert way[-1, SPEED] == close(10.0)


def test_one_with_weak_brakes_gets_down_to_a_leader_that_brakes_harder():
    leader = pieces(0.0, -100.0, 20.0, [(20.0, 2.0), (10.0, 4.0)])
    way = following(pieces(0.0, -200.0, 20.0), leader, truck(braking_mps2=1.0))
    assert way[:, ACCEL].min() == close(-1.0)
    assert way[-1, SPEED] == close(10.0)


def test_one_with_weak_brakes_goes_on_braking_after_a_leader_that_it_follows_by_hand():
    # to 15 m/s first, then the leader brakes by 2.5 m/s2 for 2 s, the follower by 1 m/s2 for 5 s:
    # that takes 12.5 and 7.5 m; (40 - 20 - 0.14) / 5 = 3.972 s
    leader = pieces(0.0, -300.0, 15.0, [(15.0, 10.0), (10.0, 2.0)])
    base = pieces(0.0, -345.0, 20.0)
    way = following(base, leader, truck(braking_mps2=1.0))
    assert way[:, 0] == close(np.array([0.0, 3.9, 8.9, 10.0, 15.0]))
    assert way[:, 2] == close(np.array([20.0, 20.0, 15.0, 15.0, 10.0]))
    assert way[:, 3] == close(np.array([0.0, -1.0, 0.0, -1.0, 0.0]))


own = st.fixed_dictionaries(
    {
        "length_m": st.sampled_from([5.0, 16.5]),
        "positioning_error_m": st.sampled_from([0.02, 1.0]),
        "clock_error_s": st.sampled_from([3e-9, 0.05]),
        "time_gap_s": st.sampled_from([0.0, 0.0, 0.6, 1.5]),
        "top_speed_mps": st.sampled_from([math.inf, 22.0, 18.0]),
        "power_wpkg": st.sampled_from([math.inf, 5.5]),
        "acceleration_mps2": st.sampled_from([math.inf, 1.0]),
        "braking_mps2": st.sampled_from([math.inf, 2.5, 1.2]),
    }
).map(lambda own: sized(**own))


@st.composite
def pairs(draw):
    """A follower that cruises, and a leader that drives slower now and then."""
    speeds = st.floats(8.0, 20.0)
    lasts = st.integers(20, 80).map(lambda n: n / 10.0)
    stretches = draw(st.lists(st.tuples(speeds, lasts), max_size=3))
    leader_mps = draw(speeds)
    previous, kept = leader_mps, []
    for reached_mps, lasts_s in stretches:
        kept.append((reached_mps, max(lasts_s, abs(reached_mps - previous) / 1.9)))
        previous = reached_mps
    behind_m = draw(st.floats(6.0, 150.0))
    leader = pieces(0.0, -350.0 + behind_m, leader_mps, kept)
    traits, leader_traits = draw(own), draw(own)
    fastest_mps = min(20.0, traits[4])
    return pieces(0.0, -350.0, draw(st.floats(8.0, fastest_mps))), leader, traits, leader_traits


def margin_m(way, leader, traits, leader_traits):
    """The least margin until the leader leaves the zone, sampled and at all knots."""
    times_s = np.concatenate([np.arange(0.0, 120.0, 0.02), way[:, TIME], leader[:, TIME]])
    times_s = times_s[sampled(leader, times_s)[0] <= END_M]
    return sampled_own_margins(leader, leader_traits, way, traits, times_s, RULES.safety).min()


@settings(max_examples=150)
@given(pair=pairs(), dip_mps=st.sampled_from([0.0, 2.0]))
def test_a_follower_keeps_its_distance_brakes_as_late_as_it_can_or_not_at_all(pair, dip_mps):
    base, leader, traits, leader_traits = pair
    way = following(base, leader, traits, leader_traits, dip_mps=dip_mps)
    if margin_m(base, *pair[1:]) >= ALLOWANCE_M + 1e-6:
        assert way.tolist() == base.tolist()
        return
    assume(len(way) > 1 or len(way) == 0)
    if len(way) == 0:
        at_once = braked(pair, 0.0)
        assert len(at_once) == 0 or margin_m(at_once, *pair[1:]) < ALLOWANCE_M + 1e-6
        return
    assert joined(way)
    assert margin_m(way, *pair[1:]) >= ALLOWANCE_M - 1e-6
    assert way[:, SPEED].max() <= max(base[0, SPEED], min(20.0, traits[4])) + 1e-9
    assert way[:, SPEED].min() >= 0.0
    assert way[:, ACCEL].min() >= -min(2.94, traits[7]) - 1e-9
    ends_mps = np.append(way[1:, SPEED], way[-1, SPEED])
    speeding_up = way[:, ACCEL] > 0.0
    able = np.minimum(traits[5], traits[6] / np.maximum(ends_mps, 1e-12))
    assert (way[speeding_up, ACCEL] <= able[speeding_up] * (1.0 + 1e-9)).all()
    brakes_s = way[1, TIME] if way[0, ACCEL] == 0.0 else 0.0
    if dip_mps == 0.0:  # a step later is too late
        assert brakes_s == pytest.approx(0.1 * round(10.0 * brakes_s), abs=1e-9)
        later = braked(pair, 0.1 * (round(10.0 * brakes_s) + 1))
        assert margin_m(later, *pair[1:]) < ALLOWANCE_M + 1e-6


def braked(pair, from_s):
    base, driven, traits, leader_traits = pair
    leader = Leader(driven, leader_traits, STREAM)
    out = np.empty((MAX_PIECES, 4))
    return out[: follow(base, from_s, 0.0, leader, traits, RULES, out)]
