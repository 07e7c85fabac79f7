"""ALINEA in SUMO: a real signal, real loops, ordinary drivers."""

import pytest

import coramp
from coramp.errors import CorampError
from coramp.strategies.alinea import Alinea

BUSY = {"mainline_veh_h": 2000.0, "ramp_veh_h": 700.0, "seed": 2, "horizon_s": 300.0}


@pytest.fixture(scope="module")
def metered():
    return coramp.run(
        "paper", "alinea", overrides={"strategy.alinea.target_occupancy_percent": 10.0}, **BUSY
    )


@pytest.fixture(scope="module")
def free():
    return coramp.run("paper", "uncontrolled", **BUSY)


def test_a_strict_target_moves_delay_from_the_mainline_to_the_ramp(metered, free):
    assert metered.summary["ramp_delay_s"] > free.summary["ramp_delay_s"] + 20.0
    assert metered.summary["mainline_delay_s"] < free.summary["mainline_delay_s"]
    assert metered.summary["unserved"] == 0


def test_nobody_collides_and_nobody_brakes_as_if_the_signal_fell_from_the_sky(metered):
    assert metered.summary["collisions"] == 0
    assert metered.summary["min_margin_m"] > 0.0
    assert metered.summary["max_decel_mps2"] < 9.0


def test_vehicles_leave_the_ramp_one_by_one_at_the_lowest_rate():
    strict = {"target_occupancy_percent": 1.0, "queue_occupancy_percent": 100.0}
    overrides = {f"strategy.alinea.{key}": value for key, value in strict.items()}
    vehicles = coramp.run("paper", "alinea", overrides=overrides, **BUSY).vehicles
    out_s = vehicles.filter(stream="ramp")["exit_s"].sort().to_numpy()
    busy = out_s[(out_s > 120.0) & (out_s < 330.0)]
    # 240 an hour are one every 15 s, in the mean
    assert (busy[-1] - busy[0]) / (len(busy) - 1) == pytest.approx(15.0, abs=2.0)


def test_a_target_that_is_never_reached_changes_nothing(free):
    generous = {"strategy.alinea.target_occupancy_percent": 80.0}
    run = coramp.run("paper", "alinea", overrides=generous, **BUSY)
    for key in ("mainline_delay_s", "ramp_delay_s", "fuel_l"):
        assert run.summary[key] == pytest.approx(free.summary[key], rel=0.02, abs=0.1)


def test_the_loop_stands_where_the_scenario_says(tmp_path):
    coramp.run(
        "paper",
        "alinea",
        horizon_s=20,
        out=tmp_path / "r",
        keep_sumo=True,
        overrides={"ramp.detector_station_m": 120.0},
    )
    assert (
        'id="mainline" lane="merge_1" pos="120.0"'
        in (tmp_path / "r" / "sumo" / "loops.add.xml").read_text()
    )
    assert "loops.add.xml" in (tmp_path / "r" / "sumo" / "command.txt").read_text()
    with pytest.raises(CorampError, match=r"ramp.detector_station_m: 250 is not beside"):
        coramp.run("paper", "alinea", overrides={"ramp.detector_station_m": 250.0})


def test_the_exact_engine_has_no_drivers_for_it():
    with pytest.raises(CorampError, match="exact has no drivers for alinea"):
        coramp.run("paper", "alinea", engine="exact")


def test_it_needs_a_signal():
    assert Alinea.metered
    assert not Alinea.cooperative
