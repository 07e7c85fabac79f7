"""A decision in the paper's symbols, as its records have it.

Times count from the decision; stations are those at the decision: what the paper calls time 0.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from coramp.equations.free_movement import ramp_stage_2_m
from coramp.records.schemas import Row
from coramp.road.rules import Rules
from coramp.strategies.attempts import CHOSEN

EVEN_M = 1e-3
"""A merge station this near to that of Eq. 12 is that of one acceleration from the nose on."""


@dataclass(frozen=True)
class Case:
    """What a decision found: lengths and stations in m, nan for none."""

    rules: Rules
    length_m: float
    clearance_m: float
    required_gap_m: float
    t1_s: float
    nose_mps: float
    free_mps2: float
    conflict_m: float
    severities: Mapping[str, float]

    @property
    def v0_mps(self) -> float:
        """The speed at which the mainline cruises."""
        return self.rules.road.mainline_speed_mps


@dataclass(frozen=True)
class Merge:
    """The merge that was chosen, in the same terms.

    X and Y are the vehicles before and behind the gap; they move by ``ahead_m`` and ``back_m`` in
    the last ``window_s`` before the merge.
    """

    rules: Rules
    length_m: float
    front_length_m: float
    clearance_m: float
    required_gap_m: float
    t1_s: float
    nose_mps: float
    accel_mps2: float
    merge_s: float
    merge_m: float
    x_m: float
    y_m: float
    gap_m: float
    ahead_m: float
    back_m: float
    window_s: float
    scenario: int
    largest_shift_m: float

    @property
    def v0_mps(self) -> float:
        """The speed at which the mainline cruises."""
        return self.rules.road.mainline_speed_mps

    @property
    def r_m(self) -> float:
        """The station from which the vehicle would reach the nose at its speed there (Eq. 24)."""
        return -self.nose_mps * self.t1_s

    @property
    def t2_s(self) -> float:
        """The time on the acceleration lane."""
        return self.merge_s - self.t1_s

    @property
    def accelerates_evenly(self) -> bool:
        """Whether it has one acceleration from the nose on, as the paper's merges have."""
        return evenly(self.nose_mps, self.accel_mps2, self.t2_s, self.merge_m)


def evenly(nose_mps: float, accel_mps2: float, t2_s: float, merge_m: float) -> bool:
    """Returns whether one acceleration from the nose on leads to the merge station (Eq. 12)."""
    return bool(abs(ramp_stage_2_m(0.0, nose_mps, accel_mps2, t2_s) - merge_m) < EVEN_M)


def number(row: Mapping[str, Any], key: str) -> float:
    """Returns a number of a row, nan for null."""
    value = row[key]
    return math.nan if value is None else float(value)


def chosen_of(attempts: Sequence[Row]) -> Row | None:
    """Returns the attempt of a decision that was carried out, None for a hold."""
    return next((row for row in attempts if row["reason"] == CHOSEN), None)


def case_of(decision: Mapping[str, Any], attempts: Sequence[Row], rules: Rules) -> Case:
    """Returns what a decision found, from its record and at least one of its attempts."""
    last = attempts[-1]
    return Case(
        rules=rules,
        length_m=number(last, "length_m"),
        clearance_m=number(last, "clearance_m"),
        required_gap_m=number(decision, "required_gap_m"),
        t1_s=number(decision, "nose_time_s") - number(decision, "time_s"),
        nose_mps=number(decision, "nose_speed_mps"),
        free_mps2=number(last, "free_accel_mps2"),
        conflict_m=number(decision, "conflict_station_m"),
        severities={
            name: number(decision, name)
            for name in (
                "severity_before",
                "severity_after",
                "relative_severity_before",
                "relative_severity_after",
            )
        },
    )


def merge_of(decision: Mapping[str, Any], chosen: Row, rules: Rules) -> Merge:
    """Returns the merge that a decision chose, from its record and the attempt chosen."""
    now_s = number(decision, "time_s")
    merge_s = number(decision, "merge_time_s")
    return Merge(
        rules=rules,
        length_m=number(chosen, "length_m"),
        front_length_m=number(chosen, "front_length_m"),
        clearance_m=number(chosen, "clearance_m"),
        required_gap_m=number(decision, "required_gap_m"),
        t1_s=number(chosen, "nose_time_s") - now_s,
        nose_mps=number(chosen, "nose_speed_mps"),
        accel_mps2=number(decision, "accel_mps2"),
        merge_s=merge_s - now_s,
        merge_m=number(decision, "merge_station_m"),
        x_m=number(decision, "front_station_m"),
        y_m=number(decision, "rear_station_m"),
        gap_m=number(decision, "gap_m"),
        ahead_m=number(chosen, "ahead_m"),
        back_m=number(chosen, "back_m"),
        window_s=merge_s - number(chosen, "moves_from_s"),
        scenario=int(decision["scenario"] or 0),
        largest_shift_m=number(decision, "largest_shift_m"),
    )
