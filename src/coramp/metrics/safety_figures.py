"""How near the vehicles of a run came, and how hard they braked."""

import math

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.metrics.frames import frame_of
from coramp.metrics.lane_uses import lane_uses
from coramp.metrics.motion import hardest_braking_mps2, largest_jerk_mps3
from coramp.metrics.separations import (
    DRAC,
    FIGURE_COUNT,
    MARGIN,
    MERGE_FRONT,
    MERGE_REAR,
    NOTED,
    SEVERITY,
    TTC,
    VIOLATION_COUNT,
    lane_extremes,
)
from coramp.metrics.types import traits_of
from coramp.records.outcome import Outcome
from coramp.records.schemas import VIOLATIONS, Row
from coramp.scenarios.model import Scenario


def safety_figures(outcome: Outcome, scenario: Scenario) -> Row:
    """Returns how near vehicles came and how hard they braked; null where no two met.

    ``max_decel_mps2`` is the hardest of anyone and positive. For drivers it is what SUMO reported
    step by step: a vehicle that SUMO stops where it can go no further has all its speed in a step.
    """
    lanes = _extremes_of_lanes(outcome, scenario)
    mainline = lanes[0]  # there the ramp merges
    margin_m, equation = _least_margin(mainline, min(float(lane[MARGIN]) for lane in lanes))
    return {
        "collisions": outcome.collisions,
        "safety_violations": int(sum(lane[VIOLATION_COUNT] for lane in lanes)),
        "min_margin_m": _finite(margin_m),
        "min_ttc_s": _finite(min(lane[TTC] for lane in lanes)),
        "max_drac_mps2": float(max(lane[DRAC] for lane in lanes)),
        "max_severity": float(mainline[SEVERITY]),
        "max_decel_mps2": float(hardest_braking_mps2(outcome.pieces.rows)),
        "max_jerk_mps3": _largest_jerk_mps3(outcome),
        "plan_error_m": _largest(outcome.passages.plan_error_m),
        "min_margin_equation": equation,
        "min_merge_margin_m": _finite(min(mainline[MERGE_FRONT], mainline[MERGE_REAR])),
    }


def _least_margin(mainline: FloatArray, following_m: float) -> tuple[float, int | None]:
    """Returns the least margin (m) over Eq. 1, or over 15 or 16 where one of these is broken.

    ``following_m`` is the former, of all lanes. With it comes the number of the equation, None
    where no two vehicles met.
    """
    by_equation = {
        1: following_m,
        15: min(mainline[MERGE_FRONT], 0.0),
        16: min(mainline[MERGE_REAR], 0.0),
    }
    broken = {number: margin for number, margin in by_equation.items() if margin < 0.0}
    candidates = broken or {1: by_equation[1]}
    equation = min(candidates, key=lambda number: float(candidates[number]))
    return float(candidates[equation]), equation if math.isfinite(candidates[equation]) else None


def _largest_jerk_mps3(outcome: Outcome) -> float:
    pieces = outcome.pieces
    return float(largest_jerk_mps3(pieces.first, pieces.rows, outcome.until_s))


def _extremes_of_lanes(outcome: Outcome, scenario: Scenario, room: int = 0) -> list[FloatArray]:
    """What ``lane_extremes`` finds on each lane of the mainline, and on the ramp."""
    rules = scenario.rules()
    return [
        lane_extremes(lane, rules.road.merge_angle_rad, rules.safety, room)
        for lane in lane_uses(outcome, traits_of(outcome.passages, scenario))
    ]


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _largest(values: FloatArray) -> float | None:
    known = values[~np.isnan(values)]
    return float(known.max()) if len(known) else None


def violations_table(outcome: Outcome, scenario: Scenario, count: int) -> pl.DataFrame:
    """Returns the ``count`` violations of a run, by time; at which the margin was least."""
    lanes = _extremes_of_lanes(outcome, scenario, count)
    told = [lane[FIGURE_COUNT:][: NOTED * int(lane[VIOLATION_COUNT])] for lane in lanes]
    noted = np.concatenate(told).reshape(-1, NOTED)
    noted = noted[np.argsort(noted[:, 0], kind="stable")]
    names = outcome.passages.vehicle_id
    return frame_of(
        VIOLATIONS,
        time_s=noted[:, 0],
        front_vehicle_id=[names[int(front)] for front in noted[:, 1]],
        rear_vehicle_id=[names[int(rear)] for rear in noted[:, 2]],
        margin_m=noted[:, 3],
    )
