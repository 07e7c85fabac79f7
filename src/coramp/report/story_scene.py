"""What a picture of one vehicle's decision shows: which decision, which vehicles, and when."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.equations.safe_distance import merge_clearance_m
from coramp.errors import CorampError
from coramp.kinematics.trajectory import TIME, station_and_speed
from coramp.records.run import RunRecords, moved_for
from coramp.records.schemas import Row
from coramp.report.plan_figure import COLUMNS
from coramp.road.lanes import LANE_CHANGE_LASTS_S, mainline_lane
from coramp.scenarios.model import Scenario
from coramp.vehicles.merge_state import BY_MAINLINE_S, NOT_PLANNED_S, is_on_mainline

BEFORE_S, AFTER_S, WITHOUT_MERGE_S = 3.0, 4.0, 20.0
"""How long before a decision and after its merge is shown, and how long if there is no merge."""
SUBJECT, FRONT, REAR, CONFLICT = "subject", "X", "Y", "conflict"
MOVED, BRAKED = "moved", "braked"
AHEAD, BEHIND = "leaves before it", "leaves after it"


@dataclass(frozen=True)
class Driven:
    """What a vehicle drove: pieces as in ``kinematics.trajectory``, from its entry to its exit.

    On the mainline it is from ``merge_s`` on, which ``vehicles.merge_state`` reads.
    """

    pieces: FloatArray
    until_s: float
    merge_s: float

    @property
    def from_s(self) -> float:
        """When it enters."""
        return float(self.pieces[0, TIME])

    def station_m(self, time_s: float) -> float:
        """Returns where its front is."""
        return float(station_and_speed(self.pieces, time_s)[0])

    def present(self, time_s: float) -> bool:
        """Returns whether it is in the zone."""
        return self.from_s <= time_s <= self.until_s

    def line(self, from_s: float, until_s: float, step_s: float) -> tuple[FloatArray, FloatArray]:
        """Returns times (s) and stations (m) within a window; nothing if it is not there then."""
        low_s, high_s = max(from_s, self.from_s), min(until_s, self.until_s)
        if low_s >= high_s:
            return np.empty(0), np.empty(0)
        times_s = np.linspace(low_s, high_s, max(2, math.ceil((high_s - low_s) / step_s) + 1))
        return times_s, np.array([self.station_m(time_s) for time_s in times_s])


@dataclass(frozen=True)
class Scene:
    """One decision with all trajectories; ``decision`` is None where there was none.

    ``asked`` is the vehicle that the picture is of, ``subject`` the one whose decision it is.
    ``roles`` say what each vehicle of interest is: SUBJECT, FRONT, REAR, MOVED or BRAKED,
    CONFLICT, or AHEAD and BEHIND where there is no decision.
    """

    asked: str
    subject: str
    decision: Row | None
    scenario: Scenario
    driven: Mapping[str, Driven]
    roles: Mapping[str, tuple[str, ...]]
    from_s: float
    until_s: float

    @property
    def merges(self) -> bool:
        """Whether the decision gave a merge."""
        return self.decision is not None and self.decision["merge_time_s"] is not None

    @cached_property
    def place_m(self) -> float:
        """The subject's station once it cruises, run back at v0 to the decision; nan for none."""
        if self.decision is None or not self.merges:
            return math.nan
        ahead_s = self.decision["merge_time_s"] - self.decision["time_s"]
        return float(self.decision["merge_station_m"] - self.scenario.mainline.speed_mps * ahead_s)

    @cached_property
    def required_gap_m(self) -> tuple[float, float]:
        """The stations that the required gap spans at the decision, around ``place_m``."""
        if self.decision is None:
            return math.nan, math.nan
        rules, required_m = self.scenario.rules(), float(self.decision["required_gap_m"])
        front_m = self.place_m + merge_clearance_m(rules.road, rules.safety)
        return front_m - required_m, front_m

    @cached_property
    def gap_m(self) -> tuple[float, float]:
        """The stations at the decision from Y's front to X's rear, infinite where there is none."""
        if self.decision is None or not self.merges:
            return math.nan, math.nan
        rear_m, front_m = self.decision["rear_station_m"], self.decision["front_station_m"]
        return (
            -math.inf if rear_m is None else float(rear_m),
            math.inf if front_m is None else float(front_m) - self.scenario.usual_length_m,
        )


def scene_of(run: RunRecords, vehicle_id: str) -> Scene:
    """Returns the scene to draw of a vehicle of a run.

    The last decision about it that gave a merge, else the last one; else the last that moved it
    for another; else its passage without any. Raises CorampError where there is no such vehicle,
    where nothing was planned, and where the vehicle never entered.
    """
    run.vehicle(vehicle_id)
    trajectories, decisions = run.coordinated("plot")
    driven = driven_of(trajectories, run.vehicles)
    if vehicle_id not in driven:
        raise CorampError(f"{vehicle_id} never entered; there is nothing to plot of it")
    driven = beside_ramp(driven, trajectories)
    if vehicle_id not in driven:
        raise CorampError(
            f"{vehicle_id} came by a lane further in; the picture is of the lane next to the ramp"
        )
    decision = _decision_of(decisions, vehicle_id)
    if decision is None:
        return _passage(run, vehicle_id, driven)
    subject, merge_s = decision["vehicle_id"], decision["merge_time_s"]
    until_s = decision["time_s"] + WITHOUT_MERGE_S if merge_s is None else merge_s + AFTER_S
    return Scene(
        vehicle_id,
        subject,
        decision,
        run.scenario,
        driven,
        {name: roles for name, roles in _roles(decision).items() if name in driven},
        decision["time_s"] - BEFORE_S,
        until_s,
    )


def driven_of(trajectories: pl.DataFrame, vehicles: pl.DataFrame) -> dict[str, Driven]:
    """Returns what each vehicle of a run drove; those that never entered are left out."""
    exits_s = dict(vehicles.select("vehicle_id", "exit_s").iter_rows())
    end_s = trajectories["time_s"].max()
    known_s = [exit_s for exit_s in exits_s.values() if exit_s is not None]
    last_s = max([*known_s, *([end_s] if isinstance(end_s, float) else [])], default=0.0)
    found = {}
    for (name,), pieces in trajectories.group_by(["vehicle_id"], maintain_order=True):
        exit_s = exits_s.get(str(name))
        rows = np.ascontiguousarray(pieces.select(COLUMNS).to_numpy())
        found[str(name)] = Driven(rows, last_s if exit_s is None else exit_s, _merge_s(pieces))
    return found


def beside_ramp(driven: Mapping[str, Driven], trajectories: pl.DataFrame) -> dict[str, Driven]:
    """Returns what vehicles drove as long as they were on the ramp or the lane next to it."""
    inner = [name for name in trajectories["lane"].unique() if mainline_lane(name) > 0]
    further_in = trajectories.filter(pl.col("lane").is_in(inner))
    left_s = dict(further_in.group_by("vehicle_id").agg(pl.col("time_s").min()).iter_rows())
    found = {}
    for name, own in driven.items():
        changes_s = left_s.get(name, math.inf)
        if changes_s > own.from_s:
            until_s = min(own.until_s, changes_s + LANE_CHANGE_LASTS_S)
            found[name] = replace(own, until_s=until_s)
    return found


def _merge_s(pieces: pl.DataFrame) -> float:
    on_mainline = [mainline_lane(name) >= 0 for name in pieces["lane"]]
    if not any(on_mainline):
        return NOT_PLANNED_S
    first = on_mainline.index(True)
    return float(pieces["time_s"][first]) if first else BY_MAINLINE_S


def _decision_of(decisions: pl.DataFrame, vehicle_id: str) -> Row | None:
    about = decisions.filter(vehicle_id=vehicle_id).rows(named=True)
    merging = [row for row in about if row["merge_time_s"] is not None]
    rows: Sequence[Row] = merging or about or moved_for(decisions, vehicle_id)
    return rows[-1] if rows else None


def _roles(decision: Row) -> dict[str, tuple[str, ...]]:
    """What each vehicle of a decision is; a vehicle can be several things at once."""
    aside = MOVED if decision["rung"] in ("create", "make way") else BRAKED
    parts = [
        (decision["vehicle_id"], SUBJECT),
        (decision["front_vehicle_id"], FRONT),
        (decision["rear_vehicle_id"], REAR),
        *((name, aside) for name in decision["adjusted_vehicle_ids"] or []),
        (decision["conflict_vehicle_id"], CONFLICT),
    ]
    found: dict[str, tuple[str, ...]] = {}
    for name, role in parts:
        if name is not None:
            found[name] = (*found.get(name, ()), role)
    return found


def _passage(run: RunRecords, vehicle_id: str, driven: Mapping[str, Driven]) -> Scene:
    """The scene of a vehicle without a decision, with the vehicles that leave before and after."""
    left = run.vehicles.filter(pl.col("exit_s").is_not_null()).sort("exit_s")["vehicle_id"]
    order, roles = left.to_list(), {vehicle_id: (SUBJECT,)}
    if vehicle_id in order:
        k = order.index(vehicle_id)
        roles |= dict.fromkeys(order[max(0, k - 1) : k], (AHEAD,))
        roles |= dict.fromkeys(order[k + 1 : k + 2], (BEHIND,))
    own = driven[vehicle_id]
    return Scene(vehicle_id, vehicle_id, None, run.scenario, driven, roles, own.from_s, own.until_s)


def lateral(scene: Scene, name: str, time_s: float, ramp_slope: float) -> float:
    """Returns across which lane a vehicle is: 0 on the mainline, -1 beside it, less up the ramp."""
    driven = scene.driven[name]
    if is_on_mainline(driven.merge_s, time_s):
        return 0.0
    return -1.0 + ramp_slope * min(0.0, driven.station_m(time_s))
