"""Commands to SUMO: a step-by-step walk of what they drive stays on the plan."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.errors import CorampError
from coramp.kinematics.trajectory import build, station_and_speed
from coramp.worlds.sumo.commands import command_table, correction
from coramp.worlds.sumo.session import Session, _check_speed

STEP_S = 0.1


def walk(commands, station_m, speed_mps, last_step):
    """Drives commands under the ballistic method; returns station and speed by step."""
    states = {int(commands[0][0]): (station_m, speed_mps)}
    pending = [list(c) for c in commands]
    step, target, steps_left, rate = int(commands[0][0]), speed_mps, 0, 0.0
    while step < last_step:
        if pending and pending[0][0] == step:
            _, target, steps, _, _ = pending.pop(0)
            steps_left = max(1, int(steps))
            rate = (target - speed_mps) / steps_left
        new_mps = speed_mps + rate if steps_left > 0 else target
        steps_left -= 1
        station_m += 0.5 * (speed_mps + new_mps) * STEP_S
        speed_mps = new_mps
        step += 1
        states[step] = (station_m, speed_mps)
    return states


stretches = st.lists(
    st.tuples(st.floats(-2.9, 2.9), st.floats(0.03, 4.0)),
    min_size=1,
    max_size=6,
)


@given(stretches)
def test_driving_the_commands_stays_on_the_plan(parts):
    pieces = build(0.0, 0.0, 40.0, parts)
    table = command_table(pieces, STEP_S, 0)
    last = int(pieces[-1, 0] / STEP_S) + 20
    driven = walk(table, 0.0, 40.0, last)
    changes = np.abs(np.diff(np.append(pieces[:, 3], 0.0)))
    bound_m = changes.sum() * STEP_S**2 / 8 + 1e-6
    for step, (station_m, _) in driven.items():
        planned_m, _ = station_and_speed(pieces, step * STEP_S)
        assert abs(station_m - planned_m) <= bound_m


@given(st.floats(0.5, 25.0), st.integers(1, 120), st.integers(0, 9000))
def test_braking_to_a_stand_commands_no_speed_below_0(speed_mps, steps, from_step):
    # the stand is at a step, where the piece before it is still evaluated
    pieces = np.array(
        [
            (from_step * STEP_S, -300.0, speed_mps, -speed_mps / (steps * STEP_S)),
            ((from_step + steps) * STEP_S, -300.0 + 0.5 * speed_mps * steps * STEP_S, 0.0, 0.0),
        ]
    )
    assert (command_table(pieces, STEP_S, from_step)[:, 1] >= 0.0).all()


@given(st.floats(0.5, 25.0), st.integers(1, 5), st.integers(0, 9000), st.floats(0.0, 1e-9))
def test_a_correction_up_to_a_stand_commands_no_speed_below_0(speed_mps, half, from_step, late_s):
    # the stand lies a rounding after a step, at which the braking has it a rounding below 0
    brake_s = 2 * half * STEP_S
    pieces = np.array(
        [
            (from_step * STEP_S, -300.0, speed_mps, -speed_mps / brake_s),
            ((from_step + 2 * half) * STEP_S + late_s, -300.0 + 0.5 * speed_mps * brake_s, 0, 0),
        ]
    )
    for error_m in (-0.02, 0.02):
        back = correction(pieces, STEP_S, from_step, error_m, speed_mps, 5)
        assert (back[:, 1] >= 0.0).all()


def test_standing_a_rounding_below_0_is_commanded_as_0():
    assert command_table(np.array([[0.0, -3.0, -2.8e-19, 0.0]]), STEP_S, 0)[0, 1] == 0.0


@given(stretches)
def test_knots_on_the_grid_are_driven_exactly(parts):
    whole = [(accel, max(1, round(duration / STEP_S)) * STEP_S) for accel, duration in parts]
    pieces = build(0.0, 0.0, 40.0, whole)
    driven = walk(command_table(pieces, STEP_S, 0), 0.0, 40.0, int(pieces[-1, 0] / STEP_S) + 5)
    for step, (station_m, speed_mps) in driven.items():
        planned_m, planned_mps = station_and_speed(pieces, step * STEP_S)
        assert station_m == pytest.approx(planned_m, abs=1e-4)
        assert speed_mps == pytest.approx(planned_mps, abs=1e-4)


@given(st.floats(-0.05, 0.05), st.floats(-0.2, 0.2), st.floats(-1.0, 1.0))
def test_a_correction_ends_on_the_plan(error_m, error_mps, accel_mps2):
    pieces = build(0.0, 0.0, 20.0, [(accel_mps2, 8.0)])
    start_m, start_mps = station_and_speed(pieces, 1.0)
    back = correction(pieces, STEP_S, 10, error_m, start_mps + error_mps, 5)
    assert len(back) == 2
    driven = walk(back, start_m + error_m, start_mps + error_mps, 20)
    planned_m, planned_mps = station_and_speed(pieces, 2.0)
    assert driven[20][0] == pytest.approx(planned_m, abs=1e-9)
    assert driven[20][1] == pytest.approx(planned_mps, abs=1e-9)


def test_no_correction_fits_before_a_near_knot():
    pieces = build(0.0, 0.0, 20.0, [(1.0, 1.1), (-1.0, 2.0)])
    assert len(correction(pieces, STEP_S, 10, 0.02, 21.0, 5)) == 0


@pytest.mark.parametrize("speed_mps", [float("nan"), float("inf"), -0.1, 101.0])
def test_no_such_speed_goes_to_sumo(speed_mps):
    with pytest.raises(CorampError, match="r1: a speed of"):
        _check_speed("r1", speed_mps)


def test_one_simulation_a_process(monkeypatch):
    monkeypatch.setattr(Session, "_owner", threading.get_ident())
    with pytest.raises(CorampError, match="one simulation a process"):
        Session([], STEP_S)


def test_what_sumo_refuses_is_our_error(tmp_path):
    with pytest.raises(CorampError, match="SUMO"):
        Session(["--net-file", str(tmp_path / "none.xml"), "--no-warnings", "true"], STEP_S)
