"""What the coordinator hears and what vehicles are told over a link that fails, and the answers."""

import numpy as np
import pytest

from coramp.mixed.situation import Steering
from coramp.scenarios.loading import load_scenario
from coramp.worlds.faults.air import Air
from tests.mixed.roads import users_of

COUNT = 400
SPEED_MPS = 20.0
EVER = {"traffic.automated_share": 0.5, "simulation.horizon_s": 900.0}


def air_of(overrides=None, count=COUNT, seed=3):
    scenario = load_scenario("paper", {**EVER, **(overrides or {})})
    return Air(scenario, np.ones(count, np.bool_), np.ones(count, np.bool_), seed)


def users_at(stations_m, speed_mps=SPEED_MPS, on_mainline=True):
    users = users_of([(x, speed_mps, on_mainline, True) for x in stations_m])
    return users._replace(number=np.arange(len(stations_m)))


def heard_m(air, now_s, users):
    """Returns the stations that are heard, nan for who is not known."""
    found = np.full(len(users.number), np.nan)
    seen = air.heard(now_s, users)
    found[seen.number] = seen.station_m
    return found


STANDING = users_at(np.linspace(-350.0, 50.0, COUNT), speed_mps=0.0)


def test_a_bias_of_20_m_is_20_m_in_what_the_coordinator_hears():
    found_m = heard_m(air_of({"positioning.bias_m": 20.0}), 1.0, STANDING)
    assert np.allclose(found_m - STANDING.station_m, 20.0)


def test_noise_is_in_what_the_coordinator_hears():
    found_m = heard_m(air_of({"positioning.noise_m": 1.5}), 1.0, STANDING)
    assert (found_m - STANDING.station_m).std() == pytest.approx(1.5, rel=0.15)


def test_noise_of_a_speed_is_in_what_the_coordinator_hears():
    users = users_at(STANDING.station_m)
    seen = air_of({"positioning.speed_noise_mps": 0.5}).heard(1.0, users)
    assert (seen.speed_mps - SPEED_MPS).std() == pytest.approx(0.5, rel=0.15)
    slow = air_of({"positioning.speed_noise_mps": 0.5}).heard(1.0, STANDING)
    assert slow.speed_mps.min() == 0.0


def test_a_report_is_carried_on_from_its_stamp():
    air = air_of({"reports.delay_s": 0.4})
    start_m = np.array([-300.0, -100.0])
    users = users_at(start_m)
    assert np.isnan(heard_m(air, 0.0, users)).all()
    assert np.isnan(heard_m(air, 0.2, users)).all()
    assert np.allclose(heard_m(air, 0.4, users), start_m + 0.4 * SPEED_MPS)


def test_a_clock_that_is_wrong_shifts_the_stamp_and_so_the_station():
    """Two seconds slow: the report seems two seconds old, and is carried on for that long."""
    air = air_of({"clock.step_s": -2.0})
    assert np.allclose(heard_m(air, 5.0, users_at([-300.0])), -300.0 + 2.0 * SPEED_MPS)
    air = air_of({"clock.step_s": 2.0})
    assert np.allclose(heard_m(air, 5.0, users_at([-300.0])), -300.0)


def test_stale_reports_are_forgotten():
    air = air_of({"reports.period_s": 10.0, "reports.stale_s": 1.0})
    users = users_at([-300.0])
    assert np.allclose(heard_m(air, 0.0, users), -300.0)
    assert np.allclose(heard_m(air, 1.0, users), -280.0)
    assert np.isnan(heard_m(air, 1.2, users)).all()


def test_a_vehicle_reports_once_a_period():
    air = air_of({"reports.period_s": 0.6})
    for step in range(16):  # 0 to 3 s
        air.heard(0.2 * step, users_at([-300.0 + 4.0 * step]))
    assert air.counts["reports_sent"] == 6


def feed(air, rows):
    """Has reports arrive in this order: number, stamp, station, speed, on the mainline."""
    air._report = lambda now_s, users: None
    for row in rows:
        air._reports.send(0.0, np.array([row], np.float64))


REPORTS = [
    (0, 0.0, -300.0, 20.0, 1, 0.0),
    (0, 0.4, -290.0, 20.0, 1, 0.0),
    (0, 0.8, -283.0, 20.0, 1, 0.0),
]


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (0, 2, 1), (2, 2, 0, 2, 1, 1), (2,)])
def test_older_and_repeated_reports_change_nothing(order):
    air = air_of({"reports.duplicates": 0.0, "reports.stale_s": 2.9})
    feed(air, [REPORTS[k] for k in order])
    assert heard_m(air, 1.0, users_at([-280.0]))[0] == pytest.approx(-283.0 + 0.2 * 20.0)


def test_losses_are_counted():
    air = air_of({"reports.loss": 0.3, "commands.loss": 0.2})
    for step in range(50):
        seen = air.heard(0.2 * step, STANDING)
        air.tell(0.2 * step, seen, steering_of(seen))
    assert air.counts["reports_sent"] == 50 * COUNT
    assert air.counts["reports_lost"] / air.counts["reports_sent"] == pytest.approx(0.3, abs=0.02)
    assert air.counts["commands_lost"] / air.counts["commands_sent"] == pytest.approx(0.2, abs=0.02)


def steering_of(seen, most_mps2=-1.0):
    count = len(seen.number)
    return Steering(np.full(count, most_mps2), np.ones(count, np.bool_), ())


def test_a_command_acts_when_it_arrives():
    air = air_of({"commands.delay_s": 0.4})
    users = users_at([-300.0])
    seen = air.heard(0.0, users)
    air.tell(0.0, seen, steering_of(seen))
    assert air.told(0.2, users)[0] == np.inf
    most_mps2, may_merge = air.told(0.4, users)
    assert most_mps2 == -1.0
    assert may_merge.all()


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (2, 2, 0, 2), (2,)])
def test_older_and_repeated_commands_change_nothing(order):
    air = air_of({"commands.duplicates": 0.0, "reports.loss": 0.1})
    for k in order:
        air._commands.send(0.0, np.array([[0, 0.1 * k, -1.0 * k, 1.0]]))
    assert air.told(0.3, users_at([-300.0]))[0] == -2.0


def test_an_overdue_command_leads_to_a_fallback_that_is_counted_once():
    air = air_of({"commands.valid_s": 1.0, "commands.delay_s": 0.2})
    users = users_at([-300.0])
    seen = air.heard(0.0, users)
    assert not np.isfinite(air.told(0.0, users)[0]).any()
    assert air.counts["fallbacks"] == 0  # it never had a command
    air.tell(0.0, seen, steering_of(users))
    assert air.told(1.0, users)[0] == -1.0
    for now_s in (1.2, 1.4, 1.6):
        most_mps2, may_merge = air.told(now_s, users)
        assert most_mps2 == 0.0
        assert may_merge.all()
        assert air.counts["fallbacks"] == 1
    air.tell(1.6, users, steering_of(users))
    assert air.told(1.8, users)[0] == -1.0
    air.told(3.0, users)
    assert air.counts["fallbacks"] == 2


def test_a_command_counts_from_when_it_was_given_not_from_when_it_arrived():
    air = air_of({"commands.valid_s": 1.0, "commands.delay_s": 0.8})
    users = users_at([-300.0])
    air.tell(0.0, users, steering_of(users))
    assert air.told(1.0, users)[0] == -1.0
    assert air.told(1.2, users)[0] == 0.0


def test_who_was_to_make_room_keeps_it_for_a_while_after_its_command_has_expired():
    """On the mainline, 2 s; on the ramp, and where it was to speed up, not at all."""
    air = air_of({"commands.valid_s": 1.0, "reports.loss": 0.1})
    users = users_at([-300.0, -200.0, -100.0])
    users = users._replace(on_mainline=np.array([True, True, False]))
    orders = steering_of(users)._replace(most_mps2=np.array([-1.0, 1.5, -1.0]))
    air.tell(0.0, users, orders)
    assert air.told(1.0, users)[0].tolist() == [-1.0, 1.5, -1.0]
    for now_s in (1.2, 3.0):
        assert air.told(now_s, users)[0].tolist() == [0.0, np.inf, np.inf]
    assert air.told(3.2, users)[0].tolist() == [np.inf, np.inf, np.inf]


def test_a_report_is_carried_on_with_the_acceleration_reported():
    """By hand: at 20 m/s with -2 m/s2 for 0.4 s, 7.84 m and 19.2 m/s."""
    air = air_of({"reports.delay_s": 0.4})
    users = users_at([-300.0])._replace(accel_mps2=np.array([-2.0]))
    air.heard(0.0, users)
    seen = air.heard(0.4, users)
    assert seen.station_m.tolist() == pytest.approx([-300.0 + 7.84])
    assert seen.speed_mps.tolist() == pytest.approx([19.2])


def test_who_is_told_to_wait_may_not_merge():
    air = air_of({"reports.loss": 0.1})
    users = users_at([150.0], on_mainline=False)
    waits = Steering(np.full(1, np.inf), np.zeros(1, np.bool_), ())
    air.tell(0.0, users, waits)
    assert not air.told(0.0, users)[1].any()
    air.tell(0.2, users, waits._replace(may_merge=np.ones(1, np.bool_)))
    assert air.told(0.2, users)[1].all()


def test_who_has_left_the_road_is_not_known():
    air = air_of({"reports.delay_s": 0.2})
    air.heard(0.0, users_at([-300.0, 390.0]))
    found = air.heard(0.4, users_at([-292.0]))
    assert found.number.tolist() == [0]


def test_a_report_is_not_carried_on_far_beyond_the_road():
    """The road ends at 400 m, and 20 m later whoever is silent is taken to have left."""
    air = air_of({"reports.period_s": 10.0, "reports.stale_s": 9.0})
    users = users_at([380.0])
    assert heard_m(air, 0.0, users) == pytest.approx(380.0)
    assert heard_m(air, 1.8, users) == pytest.approx(416.0)
    assert np.isnan(heard_m(air, 2.2, users)).all()


def test_a_vehicle_that_goes_by_itself_may_merge_where_it_sees_room():
    air = air_of({"behaviour.disobeys_share": 1.0}, 1)
    assert air.told(1.0, users_at([150.0], on_mainline=False))[1].all()
    assert air.told(1.0, users_at([190.0], speed_mps=0.0, on_mainline=False))[1].all()


def characters(overrides, seconds=900):
    """Steps through a run in which all stand; returns who is heard at its end, and is told."""
    air = air_of(overrides)
    seen = air.heard(float(seconds), STANDING)
    everyone = STANDING._replace(speed_mps=np.full(COUNT, 20.0))
    air.tell(seconds, everyone, steering_of(everyone))
    return air, seen.number, np.isfinite(air.told(float(seconds), everyone)[0])


def test_the_share_that_falls_silent_does_not_report_and_hears_nothing():
    air, heard, obeys = characters({"behaviour.silent_share": 0.25}, 900)
    silent = ~np.isin(np.arange(COUNT), heard)
    assert silent.mean() == pytest.approx(0.25, abs=0.06)
    assert np.array_equal(obeys, ~silent)
    assert not np.isfinite(air._silent_from_s).all()
    begins_s = air._silent_from_s[np.isfinite(air._silent_from_s)]
    assert begins_s.min() > 0.0
    assert begins_s.max() < 900.0
    assert begins_s.mean() == pytest.approx(450.0, rel=0.15)


def test_before_it_falls_silent_a_vehicle_reports_as_others_do():
    assert len(characters({"behaviour.silent_share": 1.0}, 0)[1]) == COUNT


def test_the_share_that_disobeys_reports_but_does_not_do_what_it_is_told():
    air, heard, obeys = characters({"behaviour.disobeys_share": 0.25})
    assert len(heard) == COUNT
    assert (~obeys).mean() == pytest.approx(0.25, abs=0.06)
    assert air.counts["fallbacks"] == 0


def test_the_share_that_lies_reports_a_station_that_is_wrong_by_the_lie():
    found_m = heard_m(
        air_of({"behaviour.lies_share": 0.25, "behaviour.lie_m": -30.0}), 1.0, STANDING
    )
    wrong_m = found_m - STANDING.station_m
    lies = np.abs(wrong_m) > 1.0
    assert np.allclose(wrong_m[lies], -30.0)
    assert np.allclose(wrong_m[~lies], 0.0)
    assert lies.mean() == pytest.approx(0.25, abs=0.06)


def test_drivers_neither_lie_nor_fall_silent():
    scenario = load_scenario("paper", {**EVER, "behaviour.lies_share": 1.0})
    air = Air(scenario, np.ones(COUNT, np.bool_), np.zeros(COUNT, np.bool_), 3)
    assert np.allclose(heard_m(air, 1.0, STANDING), STANDING.station_m)


def test_a_fault_leaves_the_draws_of_the_others():
    noise = {"positioning.noise_m": 1.5, "reports.loss": 0.3}
    plain = heard_m(air_of(noise), 1.0, STANDING)
    others = {
        "clock.offset_s": 1e-9,
        "commands.loss": 0.3,
        "commands.delay_shape": 2.0,
        "behaviour.disobeys_share": 0.5,
        "positioning.outages_per_h": 1.0,
        "positioning.speed_noise_mps": 0.1,
        "reports.duplicates": 0.3,
    }
    assert np.isnan(plain).any()
    assert not np.isnan(plain).all()
    for key, value in others.items():
        found = heard_m(air_of({**noise, key: value}), 1.0, STANDING)
        assert np.array_equal(np.isnan(found), np.isnan(plain)), key
        assert np.allclose(found, plain, equal_nan=True), key


def test_faults_that_are_off_change_nothing_of_what_is_known_and_told():
    """The way through links, with no fault on it, is that of a perfect world."""
    perfect, other = air_of(), air_of({"behaviour.never_yields_share": 0.5})
    assert perfect.is_perfect
    assert not other.is_perfect
    for step in range(20):
        users = users_at(np.linspace(-350.0, -100.0, COUNT) + 4.0 * step)
        one, two = perfect.heard(0.2 * step, users), other.heard(0.2 * step, users)
        for mine, theirs in zip(one, two, strict=True):
            assert np.array_equal(mine, theirs)
        for air in (perfect, other):
            air.tell(0.2 * step, users, steering_of(users))
        for mine, theirs in zip(
            perfect.told(0.2 * step, users), other.told(0.2 * step, users), strict=True
        ):
            assert np.array_equal(mine, theirs)
