"""What happens on a corridor, judged by SUMO's own positions and by no code of coramp's."""

import itertools
import xml.etree.ElementTree as ET

import polars as pl
import pytest

import coramp
from tests.corridors import written

EAST = ["a", "merge1", "b", "c", "merge2", "d"]  # edges of the mainline, straight along x


@pytest.fixture(scope="module")
def run(tmp_path_factory, network):
    """A run of which SUMO's files are kept: its result and its folder."""
    folder = tmp_path_factory.mktemp("run")
    path = written(folder, network, horizon_s=150.0)
    return coramp.corridor(path, out=folder / "out", keep_sumo=True), folder / "out"


def positions(folder):
    """Returns SUMO's positions with lengths, and the lane across where all edges lie along x."""
    routes = ET.parse(folder / "sumo" / "routes.rou.xml").getroot()
    length_of_type = {kind.get("id"): float(kind.get("length")) for kind in routes.iter("vType")}
    length_m = {v.get("id"): length_of_type[v.get("type")] for v in routes.iter("vehicle")}
    return (
        pl.read_parquet(folder / "sumo" / "fcd.parquet")
        .drop_nulls("vehicle_id")
        .with_columns(
            length_m=pl.col("vehicle_id").replace_strict(length_m),
            edge=pl.col("vehicle_lane").str.replace(r"_\d+$", ""),
            across=(pl.col("vehicle_y") / 3.2).floor(),
        )
    )


def gaps_m(fcd, lane, along):
    """Returns the distances between those that follow each other in one lane at one time."""
    ahead = fcd.sort("timestep_time", lane, along).with_columns(
        gap_m=(pl.col(along) - pl.col("length_m")).shift(-1).over("timestep_time", lane)
        - pl.col(along)
    )
    return ahead["gap_m"].drop_nulls()


def test_nobody_overlaps_in_any_lane(run):
    result, folder = run
    fcd = positions(folder)
    assert result.summary["collisions"] == 0
    assert gaps_m(fcd, "vehicle_lane", "vehicle_pos").min() > 0.0
    mainline = fcd.filter(pl.col("edge").is_in(EAST))
    lanes = mainline["across"].value_counts()
    assert len(lanes) == 3  # two through lanes, and the acceleration lanes
    assert gaps_m(mainline, "across", "vehicle_x").min() > 0.0


def test_everyone_leaves_by_where_he_is_to_leave(run):
    result, folder = run
    last = (
        positions(folder).sort("timestep_time").group_by("vehicle_id", maintain_order=True).last()
    )
    edge_of = dict(zip(last["vehicle_id"], last["edge"], strict=True))
    trips = result.frames["trips"]
    assert result.summary["unserved"] == 0
    assert trips["left_s"].null_count() == 0
    for row in trips.to_dicts():
        assert edge_of[row["vehicle_id"]] == (row["leaves_by"] or "d")
    out = trips.filter(pl.col("leaves_by") == "off")
    assert 0.1 < out.height / trips.filter(pl.col("origin") != "on2@merge2").height < 0.3
    seen = set(
        result.frames["passages"].filter(pl.col("site") == "on2@merge2")["vehicle_id"].to_list()
    )
    assert not seen & set(out["vehicle_id"].to_list())


def test_vehicles_are_handed_from_zone_to_zone(run):
    """Automated vehicles alone; each enters a zone and leaves it before it enters the next."""
    result, _ = run
    trips = result.frames["trips"]
    automated = set(trips.filter("automated")["vehicle_id"].to_list())
    events = result.frames["hand_overs"].sort("time_s", maintain_order=True)
    assert set(events["vehicle_id"].to_list()) == automated - nobody_in_a_zone(result)
    sites = ["on1@merge1", "on2@merge2"]
    for (name,), own in events.group_by("vehicle_id"):
        told = list(zip(own["event"], own["site"], strict=True))
        first = sites.index(told[0][1])
        passed = sites[first : first + len(told) // 2]
        expected = itertools.chain(*((("enters", s), ("leaves", s)) for s in passed))
        assert told == list(expected), name
    both = events.group_by("vehicle_id").len().filter(pl.col("len") == 4).height
    assert both > 20
    counted = result.sites.select("taken_over", "handed_on").to_dicts()
    assert all(row["taken_over"] == row["handed_on"] > 20 for row in counted)


def nobody_in_a_zone(result):
    passed = set(result.frames["passages"]["vehicle_id"].to_list())
    return set(result.frames["trips"]["vehicle_id"].to_list()) - passed


def test_figures_by_site_are_those_of_sumos_positions(run):
    """Merges are those who came by the ramp and drive on; times through a zone are SUMO's."""
    result, folder = run
    fcd = positions(folder).sort("vehicle_id", "timestep_time")
    for number, row in enumerate(result.sites.to_dicts(), 1):
        came = fcd.filter(pl.col("edge") == f"on{number}")["vehicle_id"].unique()
        on = fcd.filter(
            pl.col("vehicle_id").is_in(came.to_list()) & (pl.col("edge") == "bd"[number - 1])
        )
        assert row["merges"] == row["ramp_vehicles"] == row["ramp_served"] == len(came)
        assert set(on["vehicle_id"].to_list()) == set(came.to_list())
    passages = result.frames["passages"].filter(
        (pl.col("site") == "on1@merge1") & (pl.col("stream") == "mainline")
    )
    for row in passages.sample(30, seed=1).to_dicts():
        own = fcd.filter(pl.col("vehicle_id") == row["vehicle_id"])
        times = own.filter(
            pl.col("timestep_time").is_between(row["entered_s"], row["left_s"] - 0.2)
        )
        way_m = times["vehicle_x"].max() - times["vehicle_x"].min()
        (zone_m,) = result.sites.filter(pl.col("site") == row["site"])["zone_m"]
        assert way_m == pytest.approx(zone_m, abs=12.0)


def test_sumo_loses_no_second(run):
    """The time spent is what SUMO's trips say, waiting to enter included."""
    result, folder = run
    trips = ET.parse(folder / "sumo" / "tripinfo.xml").getroot().iter("tripinfo")
    spent_s = sum(float(t.get("duration")) + float(t.get("departDelay")) for t in trips)
    assert result.summary["time_spent_s"] == pytest.approx(spent_s, abs=1e-6)


def test_without_automated_vehicles_drivers_drive_as_if_uncontrolled(tmp_path, network):
    path = written(tmp_path, network, automated=0.0, horizon_s=60.0)
    among, alone = coramp.corridor(path), coramp.corridor(path, "uncontrolled")
    assert among.summary == alone.summary
    assert all(among.frames[name].equals(alone.frames[name]) for name in among.frames)
    assert alone.frames["hand_overs"].is_empty()
    assert alone.summary["hard_brakings_3"] > 0


def test_another_flow_of_one_ramp_shifts_no_other_arrival(tmp_path, network):
    def scheduled(ramp_flow_veh_h):
        path = written(tmp_path, network, horizon_s=60.0, ramp_flow_veh_h=ramp_flow_veh_h)
        trips = coramp.corridor(path, "uncontrolled").frames["trips"]
        return {origin: own["scheduled_s"].to_list() for (origin,), own in trips.group_by("origin")}

    few, many = scheduled([300.0, 300.0]), scheduled([300.0, 900.0])
    assert few["road1"] == many["road1"]
    assert few["on1@merge1"] == many["on1@merge1"]
    assert len(few["on2@merge2"]) < len(many["on2@merge2"])


def test_who_merged_onto_an_empty_road_lets_others_in_at_the_next_site(tmp_path, network):
    """There SUMO changes lanes by itself for one for whom it is to find that no gap is enough."""
    flows = {"mainline_flow_veh_h": 100.0, "ramp_flow_veh_h": [900.0, 900.0], "exits": []}
    path = written(tmp_path, network, 1.0, 120.0, **flows)
    result = coramp.corridor(path, overrides={"simulation.drain_s": 240.0})
    assert result.summary["unserved"] == 0
    assert result.sites["stopped_vehicles"].sum() == 0


def test_two_that_stand_for_each_other_go_on(tmp_path, a10kw):
    """One at the lane's end, and 0.9 m behind it on the mainline one that leaves it the way."""
    keys = {
        "sites": ["24498409@4054057", "308396220@264308374"],
        "mainline_flow_veh_h": 4800.0,
        "ramp_flow_veh_h": [600.0, 600.0],
        "exits": [{"edge": edge, "share": 0.1} for edge in ("151495034", "151495018")],
    }
    path = written(tmp_path, a10kw, 0.5, 300.0, **keys)
    result = coramp.corridor(path, overrides={"simulation.drain_s": 150.0})
    assert result.summary["stopped_vehicles"] > 0
    assert result.summary["unserved"] == result.summary["collisions"] == 0


def test_zones_without_an_exit_between_them_are_passed_one_after_the_other(tmp_path, without_exit):
    """The second site's mainline begins behind the first one's acceleration lane."""
    path = written(tmp_path, without_exit, 1.0, 60.0, exits=[], upstream_m=400.0)
    result = coramp.corridor(path, out=tmp_path / "out", keep_sumo=True)
    assert result.summary["unserved"] == result.summary["collisions"] == 0
    assert gaps_m(positions(tmp_path / "out"), "vehicle_lane", "vehicle_pos").min() > 0.0
    first, second = result.sites.to_dicts()
    assert second["mainline_served"] == first["mainline_served"] + first["ramp_served"]


def test_a_vehicle_that_breaks_down_stops_its_site_alone(tmp_path, network):
    """Who stands on the mainline of a zone is seen by its coordinator; nobody collides."""
    tables = {"incidents": {"breakdown_s": 40.0, "station_m": 100.0, "lasts_s": 20.0}}
    result = coramp.corridor(written(tmp_path, network, 1.0, 60.0, tables))
    assert result.summary["collisions"] == 0
    assert result.sites["stopped_vehicles"].min() >= 1
    assert result.summary["unserved"] == 0
