"""Whose fault it is: positions made up for each verdict, at steps of 0.1 s.

b is 6 m/s2, a driver keeps 2.5 m + 1 s and is let brake at 4.5 m/s2, less 1.5 m. In each test one
thing happens, and the same without it is found in order.
"""

import numpy as np
import pytest

from coramp.checker.among_drivers import (
    AMONG_DRIVERS,
    BY_AUTOMATED,
    BY_DRIVER,
    CUT_IN,
    HARD_BRAKING,
    Broken,
    Collision,
    Limits,
    Seen,
    findings_of,
)

STEP_S = 0.1
LIMITS = Limits(
    braking_mps2=6.0,
    driver_gap_m=2.5,
    driver_gap_s=1.0,
    least_driver_gap_s=1.0,
    relax_m=1.5,
    relax_at_end_m=0.0,
    lane_end_m=200.0,
)
AUTOMATED, DRIVER = True, False
FRONT_M = 100.0


class Way:
    """A vehicle's motion: from a station at a speed, each acceleration for one step."""

    def __init__(self, station_m, speed_mps, automated, accel_mps2=(), in_lane_from=0):
        self.automated, self.in_lane_from = automated, in_lane_from
        self.stations_m, self.speeds_mps = [station_m], [speed_mps]
        for accel in accel_mps2:
            new_mps = max(0.0, speed_mps + accel * STEP_S)
            station_m += 0.5 * (speed_mps + new_mps) * STEP_S
            speed_mps = new_mps
            self.stations_m.append(station_m)
            self.speeds_mps.append(speed_mps)


def seen_of(*ways):
    rows = [
        (vehicle, k * STEP_S, station_m, speed_mps, k >= way.in_lane_from)
        for vehicle, way in enumerate(ways)
        for k, (station_m, speed_mps) in enumerate(zip(way.stations_m, way.speeds_mps, strict=True))
    ]
    vehicle, time_s, station_m, speed_mps, on_mainline = zip(*rows, strict=True)
    return Seen(
        np.array(vehicle, np.int64),
        np.array(time_s),
        np.array(station_m),
        np.array(speed_mps),
        np.where(on_mainline, 0, -1),
        np.full(len(ways), 5.0),
        np.array([way.automated for way in ways], np.bool_),
    )


def found(*ways, reported=(), limits=LIMITS):
    return findings_of(seen_of(*ways), limits, reported)


def causes(findings):
    return [(c.rear, c.front, c.cause) for c in findings.collisions]


def behind(gap_m, speed_mps=20.0, automated=AUTOMATED, **more):
    """A vehicle with a gap to a 5 m long one at FRONT_M."""
    return Way(FRONT_M - 5.0 - gap_m, speed_mps, automated, **more)


STEADY = (0.0,) * 30


@pytest.mark.parametrize("rear", [AUTOMATED, DRIVER])
@pytest.mark.parametrize("front", [AUTOMATED, DRIVER])
def test_nothing_is_found_of_vehicles_that_keep_their_distance(rear, front):
    nothing = found(
        Way(FRONT_M, 20.0, front, STEADY), behind(10.0, automated=rear, accel_mps2=STEADY)
    )
    assert nothing == findings_of(seen_of(Way(0.0, 20.0, AUTOMATED)), LIMITS)
    assert (nothing.collisions, nothing.broken, nothing.unkept) == ((), (), ())


def test_an_automated_vehicle_that_runs_into_a_driver_caused_it():
    findings = found(
        Way(FRONT_M, 10.0, DRIVER, STEADY), behind(15.0, 20.0, AUTOMATED, accel_mps2=STEADY)
    )
    assert causes(findings) == [(1, 0, BY_AUTOMATED)]
    assert findings.collisions[0].time_s == pytest.approx(1.6)  # 15 m at 10 m/s, and one step
    assert findings.broken == ()


def test_a_driver_who_runs_into_an_automated_vehicle_caused_it():
    findings = found(
        Way(FRONT_M, 10.0, AUTOMATED, STEADY), behind(15.0, 20.0, DRIVER, accel_mps2=STEADY)
    )
    assert causes(findings) == [(1, 0, BY_DRIVER)]
    assert findings.unkept == ()


def test_a_collision_among_drivers_is_theirs():
    findings = found(
        Way(FRONT_M, 10.0, DRIVER, STEADY), behind(15.0, 20.0, DRIVER, accel_mps2=STEADY)
    )
    assert causes(findings) == [(1, 0, AMONG_DRIVERS)]


def test_an_automated_vehicle_hit_by_another_is_theirs():
    findings = found(
        Way(FRONT_M, 10.0, AUTOMATED, STEADY), behind(15.0, 20.0, AUTOMATED, accel_mps2=STEADY)
    )
    assert causes(findings) == [(1, 0, BY_AUTOMATED)]


def cut_in(at_step, automated=DRIVER):
    """One that comes in 8 m ahead at 10 m/s, where 10 m and more are needed from 20 m/s."""
    return found(
        Way(FRONT_M - 10.0 * STEP_S * at_step, 10.0, automated, STEADY, in_lane_from=at_step),
        Way(
            FRONT_M - 5.0 - 8.0 - 20.0 * STEP_S * at_step,
            20.0,
            AUTOMATED,
            [0.0] * at_step + [-6.0] * (30 - at_step),
        ),
    )


def test_a_collision_after_a_cut_in_is_the_drivers():
    findings = cut_in(10)
    (deed,) = findings.broken
    assert (deed.rear, deed.front, deed.what) == (1, 0, CUT_IN)
    assert deed.time_s == pytest.approx(1.0)
    assert causes(findings) == [(1, 0, BY_DRIVER)]
    assert findings.unkept == ()


def test_an_automated_vehicle_that_cuts_in_before_another_breaks_its_promise():
    findings = cut_in(10, AUTOMATED)
    assert findings.broken == ()
    assert causes(findings) == [(1, 0, BY_AUTOMATED)]
    assert [(rear, front) for _, rear, front in findings.unkept] == [(1, 0)]


def test_a_collision_after_harder_braking_is_the_drivers():
    """Brakes of 9 m/s2 stop from 20 m/s in 22.2 m, those of 6 in 33.3 m: 5 m are not enough."""
    brakes = [-9.0] * 40
    late = [-6.0] * 40
    findings = found(
        Way(FRONT_M, 20.0, DRIVER, brakes), behind(5.0, 20.0, AUTOMATED, accel_mps2=late)
    )
    (deed,) = findings.broken
    assert (deed.rear, deed.front, deed.what) == (1, 0, HARD_BRAKING)
    assert causes(findings) == [(1, 0, BY_DRIVER)]
    assert findings.unkept == ()


def test_braking_at_b_is_no_excuse():
    findings = found(
        Way(FRONT_M, 20.0, DRIVER, [-6.0] * 40),
        behind(5.0, 20.0, AUTOMATED, accel_mps2=[0.0] * 20 + [-6.0] * 20),
    )
    assert findings.broken == ()
    assert causes(findings) == [(1, 0, BY_AUTOMATED)]
    assert [(rear, front) for _, rear, front in findings.unkept] == [(1, 0)]


def test_an_automated_leader_that_brakes_harder_is_no_excuse():
    findings = found(
        Way(FRONT_M, 20.0, AUTOMATED, [-9.0] * 40),
        behind(5.0, 20.0, AUTOMATED, accel_mps2=[-6.0] * 40),
    )
    assert findings.broken == ()
    assert causes(findings) == [(1, 0, BY_AUTOMATED)]


@pytest.mark.parametrize(("speeds_up_at", "cause"), [(20, BY_DRIVER), (90, BY_AUTOMATED)])
def test_what_a_driver_did_excuses_nothing_much_later(speeds_up_at, cause):
    """He brakes harder once; the gap closes some seconds later."""
    motion = [0.0] * speeds_up_at + [2.0] * 50
    findings = found(
        Way(FRONT_M, 20.0, DRIVER, [-9.0] + [0.0] * (len(motion) - 1)),
        behind(10.0, 19.1, AUTOMATED, accel_mps2=motion),
    )
    assert [deed.what for deed in findings.broken] == [HARD_BRAKING]
    assert causes(findings) == [(1, 0, cause)]


def test_a_promise_of_distance_that_is_not_kept_is_found_without_a_collision():
    """At 20 behind 10 m/s it needs (400 - 100) / 12 = 25 m; half a metre is let go."""

    def unkept(gap_m):
        findings = found(Way(FRONT_M, 10.0, DRIVER), behind(gap_m, 20.0, AUTOMATED))
        assert findings.collisions == ()
        return findings.unkept

    assert unkept(24.51) == ()
    assert unkept(24.49) == ((0.0, 1, 0),)


def test_a_driver_promises_no_distance():
    assert found(Way(FRONT_M, 10.0, DRIVER), behind(5.0, 20.0, DRIVER)).unkept == ()


def merging(gap_m, own_mps=14.0, rear_mps=20.0, own=AUTOMATED, rear=DRIVER, more=(), **asked):
    """One that changes lanes in its second step; the other has ``gap_m`` to it then."""
    return found(
        Way(FRONT_M - own_mps * STEP_S, own_mps, own, [0.0, *more], in_lane_from=1),
        behind(gap_m + rear_mps * STEP_S, rear_mps, rear, accel_mps2=[0.0, *more]),
        **asked,
    )


def test_who_pushes_in_before_a_driver_is_found():
    """At 20 behind 14 m/s he keeps 22.5 m and brakes over (400 - 196) / 9 = 22.67 m.

    Less 1.5 m, and 1 m that he has driven on: 42.67 m.
    """
    assert merging(42.68).unkept == ()
    ((time_s, rear, front),) = merging(42.65).unkept
    assert (time_s, rear, front) == (pytest.approx(0.1), 1, 0)


def test_a_driver_who_moves_is_left_his_standstill_gap_at_least():
    """2.5 m, less 1 m that he has driven on, however much faster the vehicle ahead is."""
    assert merging(1.52, own_mps=12.0, rear_mps=4.5).unkept == ()
    assert len(merging(1.48, own_mps=12.0, rear_mps=4.5).unkept) == 1


def test_towards_the_lanes_end_he_is_left_less():
    """At 100 of 200 m, a quarter of 4 m less."""
    relaxed = LIMITS._replace(relax_at_end_m=4.0)
    assert merging(41.68, limits=relaxed).unkept == ()
    assert len(merging(41.65, limits=relaxed).unkept) == 1


def test_at_the_lanes_end_the_shortest_time_gap_is_enough():
    """At 100 of 200 m a quarter of the way from 1 to 0.6 s: 0.1 s, 2 m less."""
    various = LIMITS._replace(least_driver_gap_s=0.6)
    assert merging(40.68, limits=various).unkept == ()
    assert len(merging(40.65, limits=various).unkept) == 1


@pytest.mark.parametrize(("comes_in", "told"), [(5, 0), (4, 0), (3, 0), (2, 1), (None, 1)])
def test_a_driver_who_comes_in_behind_it_in_the_same_moment_judges_for_himself(comes_in, told):
    """He follows it on the ramp at 10 m, where he keeps 22.5 m on the mainline.

    A moment is two steps, in which it cannot learn of him any more.
    """
    own = Way(FRONT_M, 20.0, AUTOMATED, STEADY, in_lane_from=5)
    when = {} if comes_in is None else {"in_lane_from": comes_in}
    findings = found(own, behind(10.0, 20.0, DRIVER, accel_mps2=STEADY, **when))
    assert len(findings.unkept) == told


@pytest.mark.parametrize(("own", "rear"), [(DRIVER, DRIVER), (DRIVER, AUTOMATED)])
def test_drivers_may_push_in_as_they_like(own, rear):
    assert merging(30.0, own=own, rear=rear).unkept == ()


def test_before_an_automated_vehicle_its_own_distance_is_enough():
    assert merging(17.1, rear=AUTOMATED).unkept == ()  # (400 - 196) / 12 = 17 m
    assert len(merging(16.0, rear=AUTOMATED).unkept) == 1


def test_a_driver_who_hits_whoever_pushed_in_is_not_to_blame():
    assert causes(merging(5.0, more=STEADY)) == [(1, 0, BY_AUTOMATED)]


def test_a_simulators_collision_counts_where_positions_miss_it():
    apart = Way(FRONT_M, 20.0, AUTOMATED, STEADY), behind(10.0, automated=DRIVER, accel_mps2=STEADY)
    assert causes(found(*apart)) == []
    assert found(*apart, reported=[(1.0, 1, 0)]).collisions == (Collision(1.0, 1, 0, BY_DRIVER),)


def test_a_collision_seen_by_both_counts_once_from_when_it_was_seen_first():
    pair = (
        Way(FRONT_M, 10.0, DRIVER, STEADY),
        behind(15.0, 20.0, DRIVER, accel_mps2=STEADY),
    )
    findings = found(*pair, reported=[(2.5, 1, 0), (2.6, 1, 0)])
    assert [c.time_s for c in findings.collisions] == [pytest.approx(1.6)]
    findings = found(*pair, reported=[(1.2, 1, 0)])
    assert [c.time_s for c in findings.collisions] == [1.2]


def test_one_that_drives_through_another_counts_once():
    through = [0.0] * 60
    findings = found(
        Way(FRONT_M, 10.0, DRIVER, through), behind(15.0, 20.0, AUTOMATED, accel_mps2=through)
    )
    assert causes(findings) == [(1, 0, BY_AUTOMATED)]


def test_a_driver_who_drives_through_an_automated_vehicle_breaks_no_promise_of_its():
    through = [0.0] * 60
    findings = found(
        Way(FRONT_M, 10.0, AUTOMATED, through), behind(15.0, 20.0, DRIVER, accel_mps2=through)
    )
    assert causes(findings) == [(1, 0, BY_DRIVER)]
    assert (findings.broken, findings.unkept) == ((), ())


def test_a_deed_of_many_steps_is_told_once():
    findings = found(
        Way(FRONT_M, 20.0, DRIVER, [-9.0] * 15), behind(60.0, 20.0, accel_mps2=[-6.0] * 15)
    )
    assert findings.broken == (Broken(pytest.approx(0.1), 1, 0, HARD_BRAKING),)


def test_vehicles_in_different_lanes_do_not_meet():
    findings = found(
        Way(FRONT_M, 10.0, AUTOMATED, STEADY, in_lane_from=99),
        behind(5.0, 20.0, AUTOMATED, accel_mps2=STEADY),
    )
    assert (findings.collisions, findings.unkept) == ((), ())


def test_what_one_does_who_has_driven_through_another_is_not_told():
    """The driver comes out ahead after 2.5 s and then brakes by 9 m/s2, 5 m before the other."""
    slow, fast = [0.0] * 60, [0.0] * 30 + [-9.0] * 30
    findings = found(
        Way(FRONT_M, 10.0, AUTOMATED, slow), behind(15.0, 20.0, DRIVER, accel_mps2=fast)
    )
    assert causes(findings) == [(1, 0, BY_DRIVER)]
    assert (findings.broken, findings.unkept) == ((), ())


def test_how_hard_a_driver_brakes_before_a_driver_is_his_own_affair():
    findings = found(
        Way(FRONT_M, 20.0, DRIVER, [-9.0] * 15), behind(60.0, 20.0, DRIVER, accel_mps2=[-6.0] * 15)
    )
    assert findings.broken == ()


def test_a_driver_excuses_nothing_between_others():
    """He brakes harder once before A; an automated vehicle comes in between, 8 m before A."""
    steps = [0.0] * 20
    findings = found(
        Way(FRONT_M, 20.0, DRIVER, [-9.0, *steps]),
        behind(60.0, 20.0, AUTOMATED, accel_mps2=[0.0, *steps]),
        Way(FRONT_M - 52.0, 10.0, AUTOMATED, [0.0, *steps], in_lane_from=2),
    )
    assert [(deed.rear, deed.front) for deed in findings.broken] == [(1, 0)]
    assert [(rear, front) for _, rear, front in findings.unkept] == [(1, 2)]


def test_he_excuses_nobody_else_behind_him():
    """He brakes harder once before A, who leaves the road; B then runs into him."""
    steps = [0.0] * 59
    findings = found(
        Way(FRONT_M, 20.0, DRIVER, [-9.0, *steps]),
        behind(30.0, 19.0, AUTOMATED, accel_mps2=[0.0, 0.0]),
        behind(50.0, 19.1, AUTOMATED, accel_mps2=[4.0] * 60),
    )
    assert [(deed.rear, deed.front) for deed in findings.broken] == [(1, 0)]
    assert causes(findings) == [(2, 0, BY_AUTOMATED)]


def test_who_comes_upon_a_collision_breaks_no_promise_but_may_cause_the_next():
    """One drives through a slow driver within 1 s; whoever followed it is 10 m behind him then."""
    steps = [0.0] * 30
    findings = found(
        Way(FRONT_M, 3.0, DRIVER, steps),
        behind(7.0, 15.0, DRIVER, accel_mps2=steps),
        behind(7.0 + 15.0, 15.0, AUTOMATED, accel_mps2=steps),
    )
    assert causes(findings) == [(1, 0, AMONG_DRIVERS), (2, 0, BY_AUTOMATED)]
    assert findings.unkept == ()
