"""ALINEA in SUMO: a real signal, real loops, ordinary drivers."""

from typing import ClassVar

import numpy as np
import polars as pl
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
    assert metered.summary["min_margin_equation"] != 1  # drivers do not know of Eq. 15 and 16
    assert metered.summary["max_decel_mps2"] < 6.0  # drivers' noise alone makes 5.4


def test_red_waits_for_a_truck_that_can_no_longer_stop():
    mix = [{"name": "car", "share": 0.88}, {"name": "truck", "share": 0.12}]
    run = coramp.run(
        "expressway",
        "alinea",
        drivers="credible",
        mainline_veh_h=1800.0,
        ramp_veh_h=500.0,
        seed=2,
        horizon_s=195.0,
        overrides={"vehicle": mix},
    )
    # with 2 s of yellow r00023 comes to 1.3 m before the line at 17 m/s, and SUMO stops it there
    assert run.summary["max_decel_mps2"] < 7.0


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


class Watched(Alinea):
    """ALINEA that notes what its loops tell."""

    name: ClassVar[str] = "watched"
    seen: ClassVar[list] = []

    def decide(self, view, memory):
        decision = super().decide(view, memory)
        if view.detectors is not None:
            loops = view.detectors
            self.seen.append((view.time_s, loops.mainline_occupancy, loops.queue_occupancy))
        return decision


def watched(**settings):
    """A run of half an hour beyond capacity, and what the loops told from the tenth minute on."""
    coramp.register(Watched, replace=True)
    Watched.seen.clear()
    run = coramp.run(
        "paper",
        "watched",
        mainline_veh_h=2200,
        ramp_veh_h=700,
        seed=4,
        overrides={f"strategy.watched.{key}": value for key, value in settings.items()},
    )
    seen = np.array(Watched.seen)
    return run, seen[(seen[:, 0] > 600.0) & (seen[:, 0] <= 1800.0)]


@pytest.mark.parametrize("target", [18.0, 20.0])
def test_the_occupancy_settles_at_the_target_in_sumo(target):
    run, seen = watched(target_occupancy_percent=target, queue_occupancy_percent=100.0)
    assert 100.0 * seen[:, 1].mean() == pytest.approx(target, abs=1.5)
    assert run.summary["collisions"] == 0
    # what stands on the loop is seen: the ramp is full, one vehicle every 7.5 m
    assert seen[:, 2].max() == pytest.approx(1.0)


def test_a_ramp_that_is_full_is_let_go():
    held, seen = watched(target_occupancy_percent=16.0, queue_occupancy_percent=100.0)
    let_go, _ = watched(target_occupancy_percent=16.0)
    assert seen[:, 2].mean() > 0.4
    assert let_go.summary["ramp_delay_s"] < 0.5 * held.summary["ramp_delay_s"]
    assert let_go.summary["mainline_delay_s"] > held.summary["mainline_delay_s"]


@pytest.mark.parametrize("stop_line_m", [-5.0, -29.9, -150.0, -333.0])
def test_the_stop_line_may_stand_anywhere_on_the_ramp(stop_line_m, tmp_path):
    run = coramp.run(
        "paper",
        "alinea",
        overrides={
            "ramp.signal_station_m": stop_line_m,
            "strategy.alinea.target_occupancy_percent": 5.0,
            "strategy.alinea.queue_occupancy_percent": 100.0,
        },
        **{**BUSY, "horizon_s": 120.0},
        out=tmp_path / "r",
        keep_sumo=True,
    )
    assert run.summary["collisions"] == 0
    assert run.summary["unserved"] == 0
    assert run.summary["ramp_delay_s"] > 10.0
    fcd = pl.read_parquet(tmp_path / "r" / "sumo" / "fcd.parquet").drop_nulls("vehicle_id")
    waiting = fcd.filter(pl.col("vehicle_speed") < 0.05, pl.col("vehicle_lane") == "ramp_0")
    assert waiting["vehicle_pos"].max() == pytest.approx(400.0 + stop_line_m, abs=3.0)


def test_a_stop_line_at_which_nobody_could_stop_is_refused():
    # at 17 m/s a second and 0.3 g take 66.1 m
    overrides = {"ramp.signal_station_m": -334.0}
    with pytest.raises(CorampError, match=r"ramp.signal_station_m: -334 is too near .* -333.9 to"):
        coramp.run("paper", "alinea", overrides=overrides)
    assert coramp.run("paper", "uncontrolled", overrides=overrides, horizon_s=30).summary


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
