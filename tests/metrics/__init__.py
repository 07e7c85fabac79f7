"""Runs made by hand, so that every figure can be worked out on paper."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coramp.loading import load_scenario
from coramp.records import Outcome, Passages, Pieces

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

    @property
    def on_ramp(self):
        return self.name.startswith("r")


def outcome_of(cars, end_s, **rest):
    """Returns the outcome of a run with these vehicles; they drove what was planned."""
    first = np.cumsum([0, *(len(car.pieces) for car in cars)]).astype(np.int64)
    rows = np.array([row for car in cars for row in car.pieces], dtype=float).reshape(-1, 4)

    def column(name):
        return np.array([getattr(car, name) for car in cars], dtype=float)

    on_ramp = np.array([car.on_ramp for car in cars], dtype=np.bool_)
    passages = Passages(
        vehicle_id=tuple(car.name for car in cars),
        on_ramp=on_ramp,
        length_m=column("length_m"),
        scheduled_s=column("scheduled_s"),
        entry_s=column("entry_s"),
        merge_s=np.where(on_ramp, column("merge_s"), -math.inf),
        exit_s=column("exit_s"),
        plan_error_m=column("plan_error_m"),
    )
    pieces = Pieces(first, rows)
    content = {
        "cooperative": False,
        "lane": np.full(len(rows), 2),
        "driven": pieces,
        "collisions": 0,
        **rest,
    }
    return Outcome(passages=passages, pieces=pieces, end_s=end_s, **content)
