"""Runs made by hand, so that every figure can be worked out on paper."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coramp.records.lanes import planned_history, seen_history
from coramp.records.outcome import Outcome, Passages, Pieces
from coramp.road.lanes import MAINLINE, RAMP
from coramp.scenarios.loading import load_scenario

PAPER = load_scenario("paper")
NEVER = math.nan


@dataclass(frozen=True)
class Car:
    """One vehicle; its pieces are rows of time, station, speed and acceleration."""

    name: str
    pieces: Sequence[tuple[float, float, float, float]] = ()
    scheduled_s: float = 0.0
    entry_s: float = 0.0
    exit_s: float = NEVER
    merge_s: float = NEVER
    length_m: float = 5.0
    plan_error_m: float = NEVER
    entry_speed_mps: float = 20.0

    @property
    def on_ramp(self):
        return self.name.startswith("r")


def in_lanes(car):
    """Pieces with the code of the lane that each is driven in; a merge begins one of its own."""
    if not car.on_ramp:
        return [(row, MAINLINE) for row in car.pieces]
    known = []
    for k, (t, s, v, a) in enumerate(car.pieces):
        known.append(((t, s, v, a), MAINLINE if t >= car.merge_s else RAMP))
        ends_s = car.pieces[k + 1][0] if k + 1 < len(car.pieces) else math.inf
        if t < car.merge_s < ends_s:
            x = car.merge_s - t
            known.append(((car.merge_s, s + (v + a * x / 2) * x, v + a * x, a), MAINLINE))
    return known


def outcome_of(cars, end_s, **rest):
    """Returns the outcome of a run with these vehicles; they drove what was planned."""
    known = [in_lanes(car) for car in cars]
    first = np.cumsum([0, *map(len, known)]).astype(np.int64)
    rows = np.array([row for own in known for row, _ in own], dtype=float).reshape(-1, 4)
    lane = np.array([code for own in known for _, code in own], dtype=np.int64)

    def column(name):
        return np.array([getattr(car, name) for car in cars], dtype=float)

    on_ramp = np.array([car.on_ramp for car in cars], dtype=np.bool_)
    passages = Passages(
        vehicle_id=tuple(car.name for car in cars),
        on_ramp=on_ramp,
        length_m=column("length_m"),
        scheduled_s=column("scheduled_s"),
        entry_speed_mps=column("entry_speed_mps"),
        entry_s=column("entry_s"),
        merge_s=np.where(on_ramp, column("merge_s"), -math.inf),
        exit_s=column("exit_s"),
        plan_error_m=column("plan_error_m"),
    )
    pieces = Pieces(first, rows)
    content = {
        "cooperative": False,
        "lane": lane,
        "driven": pieces,
        "collisions": 0,
        **rest,
    }
    if "lanes" not in content:
        until_s = np.where(np.isnan(passages.exit_s), end_s, passages.exit_s)
        if content["cooperative"]:
            content["lanes"] = planned_history(on_ramp, passages.entry_s, passages.merge_s, until_s)
        else:
            vehicle = np.repeat(np.arange(len(cars)), np.diff(first))
            content["lanes"] = seen_history(
                vehicle, np.maximum(content["lane"] - MAINLINE, -1), rows[:, 0], until_s
            )
    return Outcome(passages=passages, pieces=pieces, end_s=end_s, **content)
