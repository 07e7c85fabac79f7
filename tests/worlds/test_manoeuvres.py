"""Each rung of the ladder has a situation that only it solves: on paper and driven in SUMO."""

import re
from pathlib import Path

import pytest

import coramp
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.plant import Arrival
from coramp.messages.feed import RequestFeed
from coramp.scenarios.model import Scenario
from coramp.scenarios.snapshots import Snapshot, load_snapshot
from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.delays import delay
from coramp.strategies.rungs import create, merge_freely, reach
from coramp.strategies.situation import assess
from coramp.vehicles.fleet import empty_proposal
from tests.outside import POSITION_ROUNDING_M, examine

FOLDER = Path(__file__).parents[1] / "manoeuvres"
NAMES = {
    "free": {"free"},
    "reach": {"reach"},
    "create-1-front-moves-ahead": {"create 1"},
    "create-2-rear-falls-back": {"create 2"},
    "create-3-both-move": {"create 3"},
    "create-cascade-of-three": {"create 1"},
    "two-in-one-gap": {"free"},
    "delay": {"delay"},
    "hold": set(),
}
ONLY_ONE = [
    "create-1-front-moves-ahead",
    "create-2-rear-falls-back",
    "create-3-both-move",
    "delay",
    "hold",
]
DECISION_S = 40.0


class Onlooker:
    """Keeps the first view that a strategy is shown, and decides nothing."""

    name, summary, cooperative = "onlooker", "", True

    def __init__(self) -> None:
        self.view: View | None = None

    def decide(self, view: View, memory: Memory) -> Decision:
        self.view = self.view or view
        return Decision()


def first_view(snapshot: Snapshot, scenario: Scenario) -> View:
    onlooker = Onlooker()
    vehicles = sorted(snapshot.vehicles, key=lambda v: (v.stream, -v.station_m))
    arrivals = [
        Arrival(v.id, v.stream == "ramp", 0, v.speed_mps, v.length_m or scenario.vehicle.length_m)
        for v in vehicles
    ]
    coordinator = Coordinator(onlooker, scenario.rules(), RequestFeed(arrivals), 20.0)
    for number, vehicle in enumerate(vehicles):
        assert coordinator.place(number, vehicle.station_m, 0)
    coordinator.decide_now(0)
    assert onlooker.view is not None
    return onlooker.view


def rungs_that_help(view: View) -> set[str]:
    """All rungs by which the first subject could merge, whichever comes first on the ladder."""
    fleet, rules = view.fleet, view.rules
    situation = assess(fleet, view.subjects[0], view.time_s, view.fastest_entry_mps, rules)
    gaps = range(len(situation.order) + 1)

    def helps(rung, *more) -> bool:
        return any(
            rung(fleet, empty_proposal(), situation, gap, *more, rules).gap >= 0 for gap in gaps
        )

    found = {f"create {n}" for n in (1, 2, 3) if helps(create, n)}
    found |= {name for name, rung in (("reach", reach), ("delay", delay)) if helps(rung)}
    if merge_freely(fleet, empty_proposal(), situation, rules).gap >= 0:
        found.add("free")
    return found


def rung_of(decision: dict) -> set[str]:
    if decision["rung"] == "hold":
        return set()
    return {f"{decision['rung']} {decision['scenario'] or ''}".strip()}


def closed_loop_file(snapshot: Snapshot, scenario: Scenario, path: Path) -> Path:
    """Writes the scenario in which everyone comes to where the snapshot has him at DECISION_S."""
    starts_m = {"mainline": scenario.mainline.start_m, "ramp": scenario.ramp.start_m}
    arrivals = sorted(
        (
            DECISION_S - (v.station_m - starts_m[v.stream]) / v.speed_mps,
            v.stream,
            v.speed_mps,
            snapshot.length_m(v),
        )
        for v in snapshot.vehicles
    )
    rows = "\n".join(
        f'  {{ stream = "{stream}", time_s = {time_s:.2f}, speed_mps = {speed}, length_m = {m} }},'
        for time_s, stream, speed, m in arrivals
    )
    built_in = Path(coramp.__file__).parent / "data" / "scenarios" / "paper.toml"
    without_flows = re.sub(r"flow_veh_h = .*\n", "", built_in.read_text())
    path.write_text(f"arrivals = [\n{rows}\n]\n" + without_flows)
    return path


@pytest.mark.parametrize("name", NAMES)
def test_the_plan_uses_the_rung(name):
    plan = coramp.plan(str(FOLDER / f"{name}.toml"))
    assert rung_of(plan.decisions.row(0, named=True)) == NAMES[name]
    if NAMES[name]:
        assert plan.decisions["min_margin_m"].min() >= 0.1 - 1e-9


@pytest.mark.parametrize("name", ONLY_ONE)
def test_no_other_rung_could_have_merged_it(name):
    snapshot = load_snapshot(str(FOLDER / f"{name}.toml"))
    helpful = rungs_that_help(first_view(snapshot, snapshot.road()))
    if name.startswith("create"):
        helpful.discard("delay")  # whoever waits long enough finds a gap behind everyone
    assert helpful == NAMES[name]


def test_reach_needs_neither_room_made_nor_free_movement():
    snapshot = load_snapshot(str(FOLDER / "reach.toml"))
    helpful = rungs_that_help(first_view(snapshot, snapshot.road()))
    assert "reach" in helpful
    assert "free" not in helpful


def test_a_cascade_moves_three():
    plan = coramp.plan(str(FOLDER / "create-cascade-of-three.toml"))
    assert plan.decisions["adjusted_vehicle_ids"].item().to_list() == ["m3", "m2", "m1"]


def test_two_ramp_vehicles_share_a_gap():
    plan = coramp.plan(str(FOLDER / "two-in-one-gap.toml"))
    assert plan.decisions["rung"].to_list() == ["free", "reach"]
    assert plan.decisions["front_vehicle_id"].to_list() == ["m1", "r1"]
    assert plan.decisions["rear_vehicle_id"].to_list() == ["m2", "m2"]


@pytest.mark.parametrize("name", NAMES)
def test_sumo_drives_it_with_the_same_rung(name, tmp_path):
    snapshot = load_snapshot(str(FOLDER / f"{name}.toml"))
    path = closed_loop_file(snapshot, snapshot.road(), tmp_path / "closed-loop.toml")
    run = coramp.run(
        str(path),
        overrides={**snapshot.set, "simulation.horizon_s": 60.0, "simulation.drain_s": 120.0},
        out=tmp_path / "run",
        keep_sumo=True,
    )
    first = run.decisions.filter(vehicle_id="r00001").row(0, named=True)
    assert first["time_s"] == pytest.approx(DECISION_S, abs=1e-6)
    assert rung_of(first) == NAMES[name]
    assert run.broken_promises == []
    assert run.summary["unserved"] == 0
    assert run.summary["plan_error_m"] <= 0.05
    seen = examine(tmp_path / "run")
    assert seen.vehicles == len(snapshot.vehicles)
    assert seen.smallest_margin_m >= -POSITION_ROUNDING_M
    assert seen.smallest_merge_margin_m >= -POSITION_ROUNDING_M
