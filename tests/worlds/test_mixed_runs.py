"""Runs of automated vehicles among drivers, in SUMO; safety from SUMO's own positions."""

import itertools
import xml.etree.ElementTree as ET

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import coramp
from coramp.demand.arrivals import arrivals_of, automated_of, connected_of
from coramp.metrics.mixed_figures import safety_events
from coramp.mixed.situation import MixedSituation
from coramp.road.lanes import MAINLINE
from coramp.runs.running import execute, make_spec
from coramp.scenarios.loading import load_scenario
from coramp.strategies.mixed_slots import MixedSlots
from coramp.worlds.faults.air import Air

NAMES = {"run_id", "strategy", "overrides", "settings", "wall_s"}
PLANNING = {"planning_median_s", "planning_p95_s"}
TYPES = [{"name": "car", "share": 0.85}, {"name": "truck", "share": 0.15}]
DEMAND = {"mainline_veh_h": 2000.0, "ramp_veh_h": 600.0, "seed": 77}


def driven(strategy="mixed-slots", overrides=None, **more):
    spec = make_spec("paper", strategy, overrides=overrides or {}, **{**DEMAND, **more})
    tables, row = execute(spec)
    return tables, {k: v for k, v in row.items() if k not in NAMES | PLANNING}


@pytest.mark.parametrize("drivers", ["fair", "credible"])
def test_without_an_automated_vehicle_a_run_is_the_uncontrolled_one(drivers):
    share = {"traffic.automated_share": 0.0, "traffic.drivers": drivers}
    own, row = driven(overrides=share, horizon_s=120.0)
    other, plain = driven("uncontrolled", drivers=drivers, horizon_s=120.0)
    assert row == plain
    assert own.frames().keys() == other.frames().keys()
    for name, frame in own.frames().items():
        assert frame.equals(other.frames()[name]), name


@pytest.mark.parametrize("engine", ["exact", "sumo"])
@pytest.mark.parametrize(
    ("order", "slots_order"), [("least-cost", "first-come"), ("ramp-first", "ramp-first")]
)
@pytest.mark.parametrize("share", [None, 1.0])
def test_with_automated_vehicles_alone_a_run_is_that_of_slots(engine, order, slots_order, share):
    overrides = {"strategy.mixed-slots.order": order}
    if share is not None:
        overrides["traffic.automated_share"] = share
    own, row = driven(overrides=overrides, engine=engine, horizon_s=60.0)
    other, plain = driven(
        "slots", {"strategy.slots.order": slots_order}, engine=engine, horizon_s=60.0
    )
    assert row == plain
    assert own.frames().keys() == other.frames().keys()
    for name, frame in own.frames().items():
        assert frame.equals(other.frames()[name]), name


SHARES = st.floats(0.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), SHARES, SHARES, st.booleans(), st.booleans())
def test_who_is_automated_at_a_share_is_so_at_a_larger_one(seed, one, other, types, of_type):
    low, high = sorted((one, other))

    def who(share):
        overrides = {"vehicle": TYPES} if types else {}
        if types and of_type:
            own = [dict(kind, automated_share=share) for kind in TYPES]
            overrides = {"vehicle": own, "traffic.automated_share": 1.0 - share}
        else:
            overrides["traffic.automated_share"] = share
        scenario = load_scenario("paper", {**overrides, "simulation.horizon_s": 60.0})
        return automated_of(scenario, arrivals_of(scenario, seed), seed)

    assert not (who(low) & ~who(high)).any()
    assert who(0.0).sum() == 0
    assert who(1.0).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), SHARES, SHARES)
def test_each_stream_and_each_type_has_its_own_share(seed, mainline, ramp):
    common = {"simulation.horizon_s": 120.0, "vehicle": TYPES}
    scenario = load_scenario(
        "paper",
        {
            **common,
            "traffic.mainline_automated_share": mainline,
            "traffic.ramp_automated_share": ramp,
        },
    )
    arrivals = arrivals_of(scenario, seed)
    on_ramp = np.array([a.on_ramp for a in arrivals])
    found = automated_of(scenario, arrivals, seed)
    for stream, share in ((on_ramp, ramp), (~on_ramp, mainline)):
        alike = load_scenario("paper", {**common, "traffic.automated_share": share})
        assert np.array_equal(found[stream], automated_of(alike, arrivals, seed)[stream])
    kinds = [TYPES[0], {**TYPES[1], "automated_share": 0.0}]
    cars = load_scenario("paper", {**common, "vehicle": kinds, "traffic.automated_share": 1.0})
    truck = np.array([a.vehicle_type == "truck" for a in arrivals])
    assert np.array_equal(automated_of(cars, arrivals, seed), ~truck)


def test_shares_are_what_is_drawn():
    scenario = load_scenario(
        "paper", {"traffic.automated_share": 0.3, "simulation.horizon_s": 7200.0}
    )
    arrivals = arrivals_of(scenario, 5)
    found = automated_of(scenario, arrivals, 5)
    for on_ramp in (False, True):
        own = found[[a.on_ramp == on_ramp for a in arrivals]]
        deviation = np.sqrt(0.3 * 0.7 / len(own))
        assert abs(own.mean() - 0.3) < 4.0 * deviation
    assert connected_of(scenario, arrivals, 5).all()


def libsumo_commands():
    """Every function of SUMO's that changes a vehicle, whoever calls it."""
    import libsumo

    names = [name for name in dir(libsumo.vehicle) if name.startswith(("set", "change", "slow"))]
    return libsumo.vehicle, [*names, "moveTo", "moveToXY", "remove", "add", "updateBestLanes"]


@pytest.fixture
def told(monkeypatch):
    """Which vehicles SUMO was told something about."""
    vehicle, names = libsumo_commands()
    told = {}

    def noting(name, own):
        def noted(vehicle_id, *values, **more):
            told.setdefault(vehicle_id, set()).add(name)
            return own(vehicle_id, *values, **more)

        return noted

    for name in names:
        monkeypatch.setattr(vehicle, name, staticmethod(noting(name, getattr(vehicle, name))))
    return told


def test_drivers_are_never_commanded_and_automated_vehicles_merge_by_command_alone(told):
    tables, row = driven(overrides={"traffic.automated_share": 0.5}, horizon_s=300.0)
    vehicles = tables.vehicles
    automated = set(vehicles.filter("automated")["vehicle_id"])
    assert 0 < len(automated) < vehicles.height
    assert set(told) == automated
    by_ramp = set(vehicles.filter(pl.col("automated"), stream="ramp")["vehicle_id"])
    assert by_ramp
    assert {name for name, what in told.items() if "changeLane" in what} == by_ramp
    assert row["automated_vehicles"] == len(automated)


class Outsider:
    """SUMO's files of a run, read with nothing of coramp's code."""

    def __init__(self, folder):
        self.folder = folder
        routes = ET.parse(folder / "sumo" / "routes.rou.xml").getroot()
        lengths = {kind.get("id"): float(kind.get("length")) for kind in routes.iter("vType")}
        self.kinds = {v.get("id"): v.get("type") for v in routes.iter("vehicle")}
        self.length_m = {name: lengths[kind] for name, kind in self.kinds.items()}

    def lanes(self):
        """Yields each time with the vehicles of a lane: place, speed, name, the rearmost first."""
        fcd = pl.read_parquet(self.folder / "sumo" / "fcd.parquet").drop_nulls("vehicle_id")
        net = ET.parse(self.folder / "sumo" / "net.net.xml").getroot()
        long_m = {lane.get("id"): float(lane.get("length")) for lane in net.iter("lane")}
        inner_m = 2e-3  # two junctions of a millimetre
        offsets = {
            "mainline_0": -long_m["mainline_0"],
            "ramp_0": -long_m["ramp_0"],
            "merge_0": 0.0,
            "merge_1": 0.0,
            "downstream_0": long_m["merge_1"] + inner_m,
        }
        fcd = fcd.filter(pl.col("vehicle_lane").is_in(list(offsets)))
        x = pl.col("vehicle_lane").replace_strict(offsets, return_dtype=pl.Float64)
        side = ~pl.col("vehicle_lane").is_in(["ramp_0", "merge_0"])
        fcd = fcd.with_columns(x=x + pl.col("vehicle_pos"), side=side)
        for (time_s, _), lane in fcd.group_by(["timestep_time", "side"], maintain_order=True):
            rows = lane.sort("x").select("x", "vehicle_speed", "vehicle_id").rows()
            yield time_s, rows

    def smallest_gap_m(self):
        smallest, overlaps = np.inf, set()
        for _, rows in self.lanes():
            for (rear_m, _, rear), (front_m, _, front) in itertools.pairwise(rows):
                gap_m = front_m - self.length_m[front] - rear_m
                smallest = min(smallest, gap_m)
                if gap_m < 0.0:
                    overlaps.add(frozenset((rear, front)))
        return smallest, overlaps

    def shortest_stopping_m(self, automated, braking_mps2):
        """The least of gap + v_l^2/(2b) - v^2/(2b) behind which an automated vehicle drove."""
        least = np.inf
        for _, rows in self.lanes():
            pairs = itertools.pairwise(rows)
            for (rear_m, rear_mps, rear), (front_m, front_mps, front) in pairs:
                if rear in automated:
                    gap_m = front_m - self.length_m[front] - rear_m
                    spare_m = gap_m + (front_mps**2 - rear_mps**2) / (2.0 * braking_mps2)
                    least = min(least, spare_m)
        return least

    def collisions(self):
        root = ET.parse(self.folder / "sumo" / "collisions.xml").getroot()
        return {frozenset((c.get("collider"), c.get("victim"))) for c in root.iter("collision")}


CASES = {
    "half": (0.5, {}),
    "quarter": (0.25, {"safety.time_gap_s": 0.5, "safety.standstill_gap_m": 2.0}),
    "most": (0.9, {"safety.time_gap_s": 0.5, "safety.standstill_gap_m": 2.0}),
    "rarely commanded": (0.5, {"strategy.mixed-slots.decision_s": 0.5}),
    "unconnected": (0.5, {"traffic.connected_share": 0.0}),
    "credible": (0.5, {"traffic.drivers": "credible"}),
    "trucks": (0.5, {"vehicle": TYPES, "traffic.drivers": "credible"}),
}


@pytest.fixture(scope="module", params=CASES, ids=lambda name: name.replace(" ", "-"))
def kept(request, tmp_path_factory):
    share, overrides = CASES[request.param]
    folder = tmp_path_factory.mktemp("mixed") / "run"
    run = coramp.run(
        "paper",
        "mixed-slots",
        **DEMAND,
        horizon_s=300.0,
        overrides={"traffic.automated_share": share, **overrides},
        out=folder,
        keep_sumo=True,
    )
    return run, Outsider(folder)


def test_an_outsider_finds_no_overlap_and_the_collisions_that_are_counted(kept):
    run, seen = kept
    smallest_m, overlaps = seen.smallest_gap_m()
    assert overlaps == set()
    assert smallest_m > 0.0
    assert len(seen.collisions() | overlaps) == run.summary["collisions"] == 0
    causes = [f"collisions_{who}" for who in ("by_automated", "by_driver", "among_drivers")]
    assert sum(run.summary[cause] for cause in causes) == 0


def test_automated_vehicles_keep_what_they_promise_and_go_where_they_are_sent(kept):
    run, seen = kept
    assert run.summary["plan_error_m"] < 0.05
    assert run.summary["collisions_by_automated"] == 0
    assert run.summary["automated_violations"] == 0
    assert run.broken_promises == []
    automated = set(run.vehicles.filter("automated")["vehicle_id"])
    if run.summary["broken_assumptions"] == 0:
        assert seen.shortest_stopping_m(automated, 6.0) > -0.5
    errors = run.vehicles.filter(~pl.col("automated"))["plan_error_m"]
    assert errors.null_count() == len(errors)


def test_sumo_is_told_who_is_automated(kept):
    run, seen = kept
    named = {name for name, kind in seen.kinds.items() if kind.startswith("automated-")}
    assert named == set(run.vehicles.filter("automated")["vehicle_id"])
    assert run.vehicles["finished"].all()


def test_safety_events_are_those_of_the_row(kept):
    run, _ = kept
    events = run.safety_events["event"].to_list()
    assert sum(event.startswith("driver ") for event in events) == run.summary["broken_assumptions"]
    nearer = events.count("automated nearer than promised")
    assert nearer == run.summary["automated_violations"]
    assert len(events) == nearer + run.summary["broken_assumptions"]


def test_a_run_is_the_same_twice():
    overrides = {"traffic.automated_share": 0.5, "vehicle": TYPES}
    (one, row), (two, again) = (driven(overrides=overrides, horizon_s=90.0) for _ in range(2))
    assert row == again
    for name, frame in one.frames().items():
        assert frame.equals(two.frames()[name]), name
    assert safety_events(one.outcome, make_spec("paper").scenario).equals(one.safety_events)


def known_numbers(monkeypatch, connected_share):
    seen = set()
    own = MixedSlots.steer

    def steer(self, situation: MixedSituation, places):
        seen.update(situation.users.number.tolist())
        return own(self, situation, places)

    monkeypatch.setattr(MixedSlots, "steer", steer)
    overrides = {"traffic.automated_share": 0.5, "traffic.connected_share": connected_share}
    tables, _ = driven(overrides=overrides, horizon_s=120.0)
    automated = tables.outcome.passages.automated
    return seen, set(np.flatnonzero(automated).tolist()), len(automated)


def test_a_driver_who_is_not_connected_is_not_known_to_the_strategy(monkeypatch):
    seen, automated, _ = known_numbers(monkeypatch, 0.0)
    assert seen == automated


def test_connected_drivers_are_known_to_the_strategy(monkeypatch):
    seen, _, everyone = known_numbers(monkeypatch, 1.0)
    assert seen == set(range(everyone))


def test_some_drivers_are_connected(monkeypatch):
    seen, automated, everyone = known_numbers(monkeypatch, 0.5)
    assert automated < seen < set(range(everyone))


def test_the_strategy_is_shown_where_vehicles_will_be_when_its_commands_act(monkeypatch):
    """Commands take 0.3 s, and a dead time of 0.2 s makes it half a second."""
    heard, shown = [], []
    hears, steers = Air.heard, MixedSlots.steer

    def hear(self, now_s, users):
        heard.append(hears(self, now_s, users))
        return heard[-1]

    def steer(self, situation: MixedSituation, places):
        shown.append((len(heard) - 1, situation.users))
        return steers(self, situation, places)

    monkeypatch.setattr(Air, "heard", hear)
    monkeypatch.setattr(MixedSlots, "steer", steer)
    late = {"commands.delay_s": 0.3, "actuators.dead_time_s": 0.2}
    driven(overrides={"traffic.automated_share": 0.5, **late}, horizon_s=60.0)
    moved = 0
    for place, users in shown:
        was = heard[place]
        then_mps = np.maximum(0.0, was.speed_mps + 0.5 * was.accel_mps2)
        assert np.allclose(users.speed_mps, then_mps)
        assert np.allclose(users.station_m - was.station_m, 0.25 * (was.speed_mps + then_mps))
        moved += int((np.abs(was.accel_mps2) > 0.5).sum())
    assert moved > 100


def test_automated_vehicles_that_nobody_coordinates_are_told_nothing(told):
    tables, row = driven(
        "uncontrolled", {"traffic.automated_share": 0.5}, drivers=None, horizon_s=60.0
    )
    assert told == {}
    assert row["automated_vehicles"] == tables.outcome.passages.automated.sum() > 0


def test_automated_vehicles_that_nobody_coordinates_promise_nothing():
    run = coramp.run(
        "paper",
        "uncontrolled",
        mainline_veh_h=1800.0,
        ramp_veh_h=500.0,
        seed=3,
        horizon_s=120.0,
        overrides={
            "traffic.automated_share": 0.5,
            "traffic.automation": "not-yielding",
            "safety.time_gap_s": 0.8,
        },
    )
    assert run.summary["automated_violations"] > 0
    assert run.broken_promises == []


def test_no_automated_vehicle_leaves_the_mainline():
    """SUMO's drivers pass one who has broken down on the acceleration lane; these must not."""
    jammed = {
        "traffic.automated_share": 0.25,
        "safety.time_gap_s": 0.5,
        "safety.standstill_gap_m": 2.0,
        "incidents.breakdown_s": 40.0,
        "incidents.station_m": 150.0,
        "incidents.lasts_s": 40.0,
    }
    flows = {"mainline_veh_h": 2200.0, "ramp_veh_h": 900.0, "seed": 73}
    tables, row = driven(overrides=jammed, **flows, horizon_s=120.0)
    outcome = tables.outcome
    leaves = {True: 0, False: 0}
    for k, automated in enumerate(outcome.passages.automated.tolist()):
        lane = outcome.lane[outcome.driven.first[k] : outcome.driven.first[k + 1]]
        leaves[automated] += int(((lane[:-1] == MAINLINE) & (lane[1:] != MAINLINE)).sum())
    assert leaves[True] == 0
    assert leaves[False] > 0
    assert row["automated_violations"] == 0
