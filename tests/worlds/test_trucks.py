"""Trucks on the expressway in both engines, judged from SUMO's own positions and by the audit."""

import json
import shutil

import numpy as np
import polars as pl
import pytest

import coramp
from coramp.audit.audit import audit
from coramp.audit.verdicts import CONFIRMED
from tests.edges import built_in
from tests.edges.test_vehicle_types import CAR, TRUCK, toml_of
from tests.outside import POSITION_ROUNDING_M, examine

FLOWS = {"mainline_veh_h": 1500, "ramp_veh_h": 600, "horizon_s": 90, "seed": 2}
PRIORITIES = ["mainline-priority", "ramp-priority"]


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("trucks") / "trucks.toml"
    path.write_text(f"{built_in('scenarios', 'expressway')}\n{toml_of([CAR, TRUCK])}")
    return str(path)


@pytest.fixture(scope="module")
def folders(scenario, tmp_path_factory):
    """The folders of all runs, by strategy and engine."""
    made = {}
    for name in PRIORITIES:
        for engine in ("exact", "sumo"):
            folder = tmp_path_factory.mktemp("runs") / f"{name}-{engine}"
            kept = {"keep_sumo": True} if engine == "sumo" else {}
            coramp.run(
                scenario, name, engine=engine, out=folder, keep_messages=True, **FLOWS, **kept
            )
            made[name, engine] = folder
    return made


def summary(folder):
    return json.loads((folder / "run.json").read_text())["summary"]


@pytest.mark.parametrize("engine", ["exact", "sumo"])
@pytest.mark.parametrize("name", PRIORITIES)
def test_everyone_is_served_and_nobody_comes_too_near(folders, name, engine):
    row = summary(folders[name, engine])
    assert (row["unserved"], row["collisions"], row["safety_violations"]) == (0, 0, 0)
    assert row["min_margin_m"] >= 0.0
    assert row["refused_plans"] == 0
    vehicles = pl.read_parquet(folders[name, engine] / "vehicles.parquet")
    trucks = vehicles.filter(pl.col("vehicle_type") == "truck")
    assert set(trucks["stream"]) == {"mainline", "ramp"}
    assert vehicles["delay_s"].min() > -0.05


@pytest.mark.parametrize("name", PRIORITIES)
def test_sumos_own_positions_keep_every_distance(folders, name):
    folder = folders[name, "sumo"]
    seen = examine(folder)
    assert seen.vehicles == pl.read_parquet(folder / "vehicles.parquet").height
    assert seen.smallest_gap_m > 0.0
    assert seen.smallest_margin_m >= -POSITION_ROUNDING_M
    assert seen.smallest_merge_margin_m >= -POSITION_ROUNDING_M
    assert seen.last_merge_station_m <= 200.0
    assert summary(folder)["plan_error_m"] < 0.05


@pytest.mark.parametrize("name", PRIORITIES)
def test_both_engines_drive_the_same_plans(folders, name):
    exact, sumo = (
        pl.read_parquet(folders[name, engine] / "trajectories.parquet")
        for engine in ("exact", "sumo")
    )
    assert exact.equals(sumo)


@pytest.mark.parametrize("name", PRIORITIES)
def test_no_truck_drives_beyond_its_power_or_its_top_speed(folders, name):
    folder = folders[name, "sumo"]
    vehicles = pl.read_parquet(folder / "vehicles.parquet")
    trucks = vehicles.filter(pl.col("vehicle_type") == "truck")
    top_mps = dict(trucks.select("vehicle_id", "top_speed_mps").rows())
    assert all(80.0 / 3.6 <= top <= 90.0 / 3.6 for top in top_mps.values())
    seen = pl.read_parquet(folder / "sumo" / "fcd.parquet").filter(
        pl.col("vehicle_id").is_in(list(top_mps))
    )
    for (truck,), steps in seen.sort("timestep_time").group_by("vehicle_id"):
        speeds = steps["vehicle_speed"].to_numpy()
        assert speeds.max() <= top_mps[truck] + 1e-3
        gains = np.diff(speeds) / 0.1
        up = gains > 0.0
        # speeds are written with four decimals
        able = np.minimum(1.0, 5.5 / np.maximum(speeds[1:], 1e-9))
        assert (gains[up] <= able[up] + 3e-3).all()


@pytest.mark.parametrize("engine", ["exact", "sumo"])
def test_the_audit_confirms_it(folders, engine):
    result = audit(folders["mainline-priority", engine])
    assert result.contradictions == []
    assert {check.verdict for check in result.checks} == {CONFIRMED}


def tampered(folder, into, change):
    """The audit of a copy of a run whose log was changed."""
    shutil.copytree(folder, into)
    path = into / "messages.parquet"
    change(pl.read_parquet(path)).write_parquet(path)
    return audit(into)


def test_a_trucks_request_made_a_cars_is_caught(folders, tmp_path):
    rows = []

    def as_car(frame):
        asks = (frame["kind"] == "request") & (frame["vehicle_type"] == "truck")
        rows.append(asks.to_list().index(True))
        here = pl.int_range(pl.len()) == rows[0]
        told = {"vehicle_type": "car", "length_m": 5.0, "mass_kg": 1500.0}
        bound = ("top_speed_mps", "acceleration_mps2", "power_wpkg", "braking_mps2")
        told |= dict.fromkeys(bound)
        return frame.with_columns(
            pl.when(here).then(pl.lit(value)).otherwise(pl.col(name)).alias(name)
            for name, value in told.items()
        )

    result = tampered(folders["mainline-priority", "exact"], tmp_path / "r", as_car)
    assert not result.holds
    assert rows[0] in [found.row for found in result.contradictions]


@pytest.mark.parametrize(
    ("name", "value"), [("vehicle_type", "car"), ("power_wpkg", 9.0), ("top_speed_mps", None)]
)
def test_one_word_of_a_trucks_request_changed_is_caught(folders, tmp_path, name, value):
    def changed(frame):
        asks = (frame["kind"] == "request") & (frame["vehicle_type"] == "truck")
        here = pl.int_range(pl.len()) == asks.to_list().index(True)
        return frame.with_columns(
            pl.when(here).then(pl.lit(value)).otherwise(pl.col(name)).alias(name)
        )

    assert not tampered(folders["mainline-priority", "exact"], tmp_path / "r", changed).holds


def test_a_command_above_a_trucks_power_is_caught_by_kinematics(folders, tmp_path):
    rows = []

    def harder(frame):
        """A truck's first way that speeds up, with a piece of 0.1 s at 3 m/s2 before its end."""
        trucks = frame.filter(vehicle_type="truck")["vehicle_id"].to_list()
        orders = frame.with_row_index().filter(
            pl.col("kind").is_in(["entry", "command"]) & pl.col("vehicle_id").is_in(trucks)
        )
        row = int(orders["index"][-1])
        rows.append(row)
        here = pl.int_range(pl.len()) == row
        told = frame.row(row, named=True)
        t, s, v = (told[f"piece_{name}"][-1] for name in ("time_s", "station_m", "speed_mps"))
        ends = {
            "piece_time_s": t + 0.1,
            "piece_station_m": s + 0.1 * v + 0.5 * 3.0 * 0.01,
            "piece_speed_mps": v + 0.3,
            "piece_accel_mps2": 0.0,
        }
        columns = []
        for name, value in ends.items():
            kept = list(told[name])
            if name == "piece_accel_mps2":
                kept[-1] = 3.0
            new = pl.lit(pl.Series([[*kept, value]])).first()
            columns.append(pl.when(here).then(new).otherwise(pl.col(name)).alias(name))
        return frame.with_columns(columns)

    result = tampered(folders["mainline-priority", "exact"], tmp_path / "r", harder)
    against = {found.against for found in result.contradictions if found.row == rows[0]}
    assert against >= {"kinematics", "a decision"}


@pytest.mark.parametrize("name", ["uncontrolled", "alinea"])
def test_drivers_of_trucks_run_in_sumo(scenario, tmp_path, name):
    folder = tmp_path / "r"
    coramp.run(
        scenario,
        name,
        out=folder,
        mainline_veh_h=900,
        ramp_veh_h=300,
        horizon_s=60,
        keep_sumo=True,
    )
    row = summary(folder)
    assert (row["unserved"], row["collisions"]) == (0, 0)
    vehicles = pl.read_parquet(folder / "vehicles.parquet")
    trucks = vehicles.filter(vehicle_type="truck")
    assert trucks.height > 0
    seen = pl.read_parquet(folder / "sumo" / "fcd.parquet")
    for truck, top_mps in trucks.select("vehicle_id", "top_speed_mps").rows():
        speeds = seen.filter(vehicle_id=truck)["vehicle_speed"]
        assert speeds.max() <= top_mps + 1e-3


def test_figures_by_type_are_kept(folders):
    folder = folders["ramp-priority", "sumo"]
    types = pl.read_parquet(folder / "types.parquet")
    vehicles = pl.read_parquet(folder / "vehicles.parquet")
    assert types["vehicles"].sum() == vehicles.height
    assert types["fuel_l"].sum() == pytest.approx(vehicles["fuel_l"].sum())
    per_vehicle = {
        kind: group["fuel_l"].sum() / group["vehicles"].sum()
        for (kind,), group in types.group_by("vehicle_type")
    }
    assert per_vehicle["truck"] > 4.0 * per_vehicle["car"]
