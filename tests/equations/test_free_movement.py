"""Eq. 10-14 and 24-26, for a ramp vehicle from -160 m at 16 m/s that takes 2 m/s2 up to 20 m/s.

It passes the nose at 10 s, merges at 12 s at station 16 * 2 + 2 * 2^2 / 2 = 36 m.
"""

import numpy as np
import pytest

from coramp.equations.free_movement import (
    acceleration_time_s,
    mainline_station_m,
    nose_time_s,
    ramp_stage_1_m,
    ramp_stage_2_m,
    ramp_stage_3_m,
    ramp_station_m,
    ramp_trajectory,
)
from tests.mathematics import close, sampled


def test_eq_10_mainline_vehicle_cruises():
    assert mainline_station_m(-300.0, 20.0, 7.5) == close(-150.0)


def test_eq_11_on_the_ramp():
    assert ramp_stage_1_m(-160.0, 16.0, 4.0) == close(-96.0)


def test_eq_12_on_the_acceleration_lane():
    assert ramp_stage_2_m(-160.0, 16.0, 2.0, 11.0) == close(17.0)  # 16 + 1


def test_eq_13_on_the_mainline():
    assert ramp_stage_3_m(-160.0, 16.0, 20.0, 2.0, 15.0) == close(96.0)  # 36 + 20 * 3


@pytest.mark.parametrize(
    ("time_s", "station_m"),
    [(0.0, -160.0), (4.0, -96.0), (10.0, 0.0), (11.0, 17.0), (12.0, 36.0), (15.0, 96.0)],
)
def test_eq_14_takes_the_stage_that_holds(time_s, station_m):
    assert ramp_station_m(-160.0, 16.0, 20.0, 2.0, time_s) == close(station_m)


def test_eq_24_time_to_the_nose():
    assert nose_time_s(-160.0, 16.0) == close(10.0)
    assert nose_time_s(-5.0, 0.5) == close(10.0)


def test_eq_25_and_26_time_on_the_acceleration_lane():
    assert acceleration_time_s(20.0, 16.0, 2.0) == close(2.0)
    assert acceleration_time_s(20.0, 16.0, 1.5) == close(2.6666666666666667)
    assert acceleration_time_s(20.0, 16.0, 0.5) == close(8.0)


def test_trajectory_is_eq_14_from_its_start_time_on():
    trajectory = ramp_trajectory(3.0, -160.0, 16.0, 20.0, 2.0)
    expected = [[3.0, -160.0, 16.0, 0.0], [13.0, 0.0, 16.0, 2.0], [15.0, 36.0, 20.0, 0.0]]
    assert trajectory == close(np.array(expected))


def test_trajectory_and_eq_31_agree_with_an_adjusted_acceleration():
    times_s = np.arange(0.0, 25.0, 0.25)
    stations_m, _ = sampled(ramp_trajectory(0.0, -100.0, 50 / 3, 250 / 9, 1.5), times_s)
    printed = [ramp_station_m(-100.0, 50 / 3, 250 / 9, 1.5, time_s) for time_s in times_s]
    assert printed == close(stations_m)


def test_ramp_speed_must_be_positive():
    with pytest.raises(ValueError, match="ramp speed must be positive"):
        nose_time_s(-160.0, 0.0)


def test_acceleration_must_be_positive():
    with pytest.raises(ValueError, match="acceleration must be positive"):
        acceleration_time_s(20.0, 16.0, 0.0)
