"""What automated vehicles and drivers each get of a run in which both are on the road."""

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.checker.among_drivers import (
    AMONG_DRIVERS,
    BY_AUTOMATED,
    BY_DRIVER,
    Findings,
    Limits,
    Seen,
    findings_of,
)
from coramp.metrics.conflicts import conflicts_of
from coramp.metrics.frames import frame_of
from coramp.metrics.motion import distance_of_each_m, hard_brakings, stopped_vehicles
from coramp.metrics.types import traits_of
from coramp.mixed.laws import LANE_END_M, SafetyLaw
from coramp.records.outcome import Outcome, Pieces
from coramp.records.schemas import MIXED_METRICS, SAFETY_EVENTS, Row
from coramp.road.lanes import MAINLINE
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation
from coramp.vehicles.traits import MASS

HARD_MPS2 = 3.0
NOBODY = -1
MESSAGES_OF_AIR = ("reports_sent", "reports_lost", "commands_sent", "commands_lost", "fallbacks")
NEARER = "automated nearer than promised"


def mixed_figures(outcome: Outcome, scenario: Scenario, delay_s: FloatArray) -> Row:
    """Returns the figures by kind of vehicle, and whose fault collisions were; else null.

    Runs of drivers alone have the distance that was driven, and conflicts where the world is not
    perfect.
    """
    automated = outcome.passages.automated
    figures: Row = dict.fromkeys(MIXED_METRICS)
    if outcome.drivers:
        figures["vehicle_km"] = float(distance_of_each_m(*_driven(outcome)).sum()) / 1000.0
    if automated is not None or scenario.has_faults:
        figures.update(_conflicts(outcome, scenario))
    if automated is None:
        return figures
    found = findings_in(outcome, scenario)
    causes = [collision.cause for collision in found.collisions]
    return {
        **figures,
        "automated_vehicles": int(automated.sum()),
        "automated_delay_s": _mean(delay_s[automated]),
        "driver_delay_s": _mean(delay_s[~automated]),
        "automated_hard_brakings_3": _hard_brakings(outcome, automated),
        "driver_hard_brakings_3": _hard_brakings(outcome, ~automated),
        "ramp_stops": _ramp_stops(outcome, scenario),
        "collisions_by_automated": causes.count(BY_AUTOMATED),
        "collisions_by_driver": causes.count(BY_DRIVER),
        "collisions_among_drivers": causes.count(AMONG_DRIVERS),
        "broken_assumptions": len(found.broken),
        "automated_violations": len(found.unkept),
        **{name: outcome.messages_of_air.get(name) for name in MESSAGES_OF_AIR},
    }


def findings_in(outcome: Outcome, scenario: Scenario) -> Findings:
    """Returns what the checker finds in the positions of a run, of drivers alone too."""
    automated = outcome.passages.automated
    if automated is None:
        automated = np.zeros(len(outcome.passages), np.bool_)
    limits = limits_of(scenario, scenario.drivers[outcome.drivers])
    return findings_of(_seen(outcome, automated), limits, outcome.collided)


def _seen(outcome: Outcome, automated: BoolArray) -> Seen:
    """Where the simulator had whom at each of its steps."""
    passages, driven = outcome.passages, outcome.driven
    vehicle = np.repeat(np.arange(len(passages)), np.diff(driven.first))
    time_s, station_m, speed_mps, _ = driven.rows.T
    lane = np.maximum(outcome.lane - MAINLINE, -1)  # all that is no mainline is the ramp's
    return Seen(vehicle, time_s, station_m, speed_mps, lane, passages.length_m, automated)


def _conflicts(outcome: Outcome, scenario: Scenario) -> Row:
    """How many conflicts there were, by how grave they are; nobody needs to be automated."""
    passages = outcome.passages
    automated = passages.automated
    if automated is None:
        automated = np.zeros(len(passages), np.bool_)
    mass_kg = traits_of(passages, scenario)[:, MASS]
    return conflicts_of(_seen(outcome, automated), outcome.driven.first, mass_kg).counts()


def limits_of(scenario: Scenario, drivers: DriverPopulation) -> Limits:
    """Returns what automated vehicles reckon with on this road, among these drivers."""
    law = SafetyLaw().on(scenario.road.assumed_braking_mps2)
    return Limits(
        law.braking_mps2,
        drivers.min_gap_m,
        drivers.mean_tau_s,
        min(drivers.taus_s),
        law.relax_m,
        law.relax_at_end_m,
        scenario.ramp.acceleration_lane_m - LANE_END_M,
    )


def safety_events(outcome: Outcome, scenario: Scenario) -> pl.DataFrame:
    """Returns one row per collision, broken assumption, broken promise and event of the world."""
    found = findings_in(outcome, scenario)
    events = [(c.time_s, f"collision {c.cause}", c.rear, c.front) for c in found.collisions]
    events += [(b.time_s, f"driver {b.what}", b.rear, b.front) for b in found.broken]
    events += [(time_s, NEARER, rear, front) for time_s, rear, front in found.unkept]
    events += [(time_s, what, place, NOBODY) for time_s, what, place in outcome.world_events]
    events.sort()
    names = outcome.passages.vehicle_id
    return frame_of(
        SAFETY_EVENTS,
        time_s=[event[0] for event in events],
        event=[event[1] for event in events],
        rear_vehicle_id=[names[event[2]] for event in events],
        front_vehicle_id=[names[event[3]] if event[3] >= 0 else None for event in events],
    )


def _mean(values: FloatArray) -> float | None:
    return float(values.mean()) if len(values) else None


def _of(pieces: Pieces, chosen: BoolArray) -> Pieces:
    """The pieces of the chosen vehicles alone; others have none."""
    counts = np.diff(pieces.first)
    rows = pieces.rows[np.repeat(chosen, counts)]
    first = np.concatenate([[0], np.cumsum(np.where(chosen, counts, 0))]).astype(np.int64)
    return Pieces(first, np.ascontiguousarray(rows))


def _hard_brakings(outcome: Outcome, chosen: BoolArray) -> int:
    own = _of(outcome.driven, chosen)
    return int(hard_brakings(own.first, own.rows, outcome.until_s, HARD_MPS2))


def _driven(outcome: Outcome) -> tuple[IntArray, FloatArray, FloatArray]:
    return outcome.driven.first, outcome.driven.rows, outcome.until_s


def _ramp_stops(outcome: Outcome, scenario: Scenario) -> int:
    passages = outcome.passages
    own = _of(outcome.driven, passages.on_ramp)
    end_m = scenario.ramp.acceleration_lane_m
    return int(stopped_vehicles(own.first, own.rows, outcome.until_s, passages.merge_s, end_m))
