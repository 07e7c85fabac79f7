"""One decision on a snapshot: every ramp vehicle in it is planned, front first."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.driven import driven_pieces
from coramp.coordination.guard import strategy_to_run
from coramp.coordination.plant import Arrival
from coramp.errors import CorampError
from coramp.messages.feed import RequestFeed
from coramp.metrics.attempts import attempts_table
from coramp.metrics.frames import decisions_table
from coramp.records.schemas import TRAJECTORIES
from coramp.road.lanes import LANES
from coramp.scenarios.model import Scenario
from coramp.scenarios.snapshots import Snapshot, SnapshotVehicle
from coramp.strategies.base import period_of
from coramp.strategies.registry import strategy_named


@dataclass(frozen=True)
class PlannedSnapshot:
    """What was decided, and the trajectories before and after."""

    snapshot: Snapshot
    scenario: Scenario
    strategy: str
    decisions: pl.DataFrame
    attempts: pl.DataFrame
    before: pl.DataFrame
    after: pl.DataFrame


def plan_snapshot(snapshot: Snapshot, strategy: str) -> PlannedSnapshot:
    """Returns the decisions of a strategy on a snapshot, at time 0.

    Raises CorampError where the strategy plans nothing, or the situation is lost already.
    """
    scenario = snapshot.road()
    chosen = strategy_to_run(strategy, scenario.strategy.get(strategy))
    if period_of(chosen) is not None:
        raise CorampError(
            f"strategy: {strategy} steers step by step and plans nothing ahead; "
            "choose one that plans"
        )
    if scenario.vehicles_differ:
        raise CorampError(
            "vehicle: a situation is planned for vehicles that are alike but for their length; "
            "allowed are types without limits of their own"
        )
    if scenario.mainline.lanes > 1:
        raise CorampError(
            f"mainline.lanes: a situation is planned on one lane, not on "
            f"{scenario.mainline.lanes}; allowed is 1"
        )
    if not strategy_named(strategy).cooperative:
        raise CorampError(f"strategy: {strategy} plans nothing; choose a cooperative one")
    vehicles = sorted(snapshot.vehicles, key=lambda v: (v.stream, -v.station_m))
    arrivals = [
        Arrival(v.id, v.stream == "ramp", 0, v.speed_mps, v.length_m or scenario.usual_length_m)
        for v in vehicles
    ]
    coordinator = Coordinator(
        chosen, scenario.rules(), RequestFeed(arrivals), scenario.fastest_mainline_entry_mps
    )
    for number, vehicle in enumerate(vehicles):
        if not coordinator.place(number, vehicle.station_m, 0):
            raise CorampError(
                f"vehicles: {vehicle.id} can no longer keep its distance; allowed are situations "
                "in which braking is still enough"
            )
    before = _trajectories(coordinator, vehicles)
    coordinator.decide_now(0)
    names, rows = [vehicle.id for vehicle in vehicles], np.arange(len(vehicles))
    return PlannedSnapshot(
        snapshot,
        scenario,
        strategy,
        decisions_table(coordinator.decisions, names, rows),
        attempts_table(coordinator.decisions, coordinator.refusals, names, rows),
        before,
        _trajectories(coordinator, vehicles),
    )


def _trajectories(coordinator: Coordinator, vehicles: Sequence[SnapshotVehicle]) -> pl.DataFrame:
    ledger = coordinator.ledger
    exits_s = [ledger.exit_time_s(row) for row in range(len(ledger))]
    end_s = max([exit_s for exit_s in exits_s if np.isfinite(exit_s)], default=60.0)
    first, lane, rows = driven_pieces(ledger, np.arange(len(vehicles)), len(vehicles), end_s)
    names = [v.id for v, n in zip(vehicles, np.diff(first), strict=True) for _ in range(n)]
    columns = [names, [LANES[code] for code in lane], *(rows[:, k] for k in range(4))]
    return pl.DataFrame(dict(zip(TRAJECTORIES, columns, strict=True)), schema=TRAJECTORIES)
