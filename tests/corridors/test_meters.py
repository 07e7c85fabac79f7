"""Meters of a corridor in SUMO: a signal at each ramp, coordinated by HERO or each by itself."""

import polars as pl
import pytest

import coramp
from coramp.errors import CorampError
from coramp.strategies.uncontrolled import Uncontrolled
from tests.corridors import written

STRICT = {
    "corridor.mainline_flow_veh_h": 2400.0,
    "corridor.ramp_flow_veh_h": [500.0, 900.0],
    "simulation.horizon_s": 100.0,
}
"""Whoever is at 3 % of occupancy meters as strictly as it can."""


def run(path, strategy, tmp_path=None, **more):
    own = {"target_occupancy_percent": 3.0, "update_s": 10.0}
    overrides = {f"strategy.{strategy}.{key}": value for key, value in own.items()}
    kept = {} if tmp_path is None else {"out": tmp_path / strategy, "keep_sumo": True}
    return coramp.corridor(
        path, strategy, drivers="credible", overrides={**STRICT, **overrides, **more}, **kept
    )


@pytest.fixture(scope="module")
def alinea(network, tmp_path_factory):
    folder = tmp_path_factory.mktemp("alinea")
    return run(written(folder, network), "alinea", folder), folder


def test_each_ramp_is_metered_by_itself(alinea):
    meters = alinea[0].frames["meters"]
    assert set(meters["role"]) == {"alone"}
    assert meters["master"].to_list() == meters["site"].to_list()
    assert meters.group_by("site").len()["len"].n_unique() == 1
    lowest = meters.group_by("site").agg(pl.col("rate_veh_h").min())["rate_veh_h"]
    assert lowest.to_list() == [240.0, 240.0]
    assert meters.filter(pl.col("let_go"))["rate_veh_h"].to_list() in ([], [1200.0])
    assert alinea[0].summary["collisions"] == alinea[0].summary["unserved"] == 0


def test_who_is_metered_waits_at_the_stop_line_in_sumos_own_positions(alinea):
    fcd = pl.read_parquet(alinea[1] / "alinea" / "sumo" / "fcd.parquet").drop_nulls("vehicle_id")
    for edge in ("on1", "on2"):
        lane = pl.col("vehicle_lane") == f"{edge}-before-stopline_0"
        waiting = fcd.filter(lane, pl.col("vehicle_speed") < 0.05)
        behind = fcd.filter(pl.col("vehicle_lane") == f"{edge}_0")
        first = fcd.filter(lane)["vehicle_pos"].max()
        assert waiting["vehicle_id"].n_unique() >= 3
        assert first - waiting["vehicle_pos"].max() < 3.0
        # one a green: 15 s apart once the lowest rate holds
        came_s = behind.group_by("vehicle_id").agg(pl.col("timestep_time").min())
        last_s = came_s["timestep_time"].sort().tail(3)
        assert last_s.diff().drop_nulls().min() > 14.0


def test_the_queue_is_who_is_before_the_stop_line(alinea):
    fcd = pl.read_parquet(alinea[1] / "alinea" / "sumo" / "fcd.parquet").drop_nulls("vehicle_id")
    for row in alinea[0].frames["meters"].iter_rows(named=True):
        edge = row["site"].partition("@")[0]
        # a row of time t has positions as of one step later than SUMO's step that was the last
        at = (pl.col("timestep_time") - (row["time_s"] - 0.1)).abs() < 0.01
        on = fcd.filter(at, pl.col("vehicle_lane") == f"{edge}-before-stopline_0")
        assert len(on) == row["queue_veh"]


def test_hero_has_the_ramp_upstream_hold_back(network, tmp_path, alinea):
    path = written(tmp_path, network)
    begins = {"strategy.hero.begins_percent": 20.0, "strategy.hero.ends_percent": 5.0}
    # upstream alone there would be no reason to meter: its target is never reached
    found = run(path, "hero", **begins)
    meters = found.frames["meters"]
    roles = {site: set(meters.filter(site=site)["role"]) for site in ("on1@merge1", "on2@merge2")}
    assert "master" in roles["on2@merge2"]
    assert "slave" in roles["on1@merge1"]
    slaves = meters.filter(role="slave")
    assert set(slaves["master"]) == {"on2@merge2"}
    assert found.summary["collisions"] == 0
    assert found.content["strategy"] == "hero"


def test_nothing_is_metered_where_nobody_meters(network, tmp_path):
    found = coramp.corridor(
        written(tmp_path, network), "uncontrolled", overrides={"simulation.horizon_s": 5.0}
    )
    assert "meters" not in found.frames


def test_what_cannot_meter_a_corridor_is_refused(network, tmp_path):
    class Mine(Uncontrolled):
        """A strategy of one's own that meters one ramp."""

        name = "mine"
        metered = True
        period_s = 1.0

    coramp.register(Mine, replace=True)
    path = written(tmp_path, network)
    with pytest.raises(CorampError, match=r"mine meters one ramp, .*; allowed are alinea, hero"):
        coramp.corridor(path, "mine")
    alone = written(tmp_path, network, sites=["on2@merge2"], ramp_flow_veh_h=[300.0])
    with pytest.raises(CorampError, match="hero coordinates ramps one behind the other"):
        coramp.corridor(alone, "hero")
    with pytest.raises(CorampError, match="hero coordinates the meters of several ramps"):
        coramp.run("paper", "hero")
