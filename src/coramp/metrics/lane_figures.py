"""How near a run came to what its lane allows, and how roughly its vehicles drove."""

import math

import numpy as np

from coramp._kernel import FloatArray
from coramp.core.rules import packed
from coramp.metrics.delay_bound import (
    Arrived,
    delay_bound,
    earliest_exits_s,
    first_come_exits_s,
    lane_headway_s,
    lane_limit_veh_h,
    quickest_exits_s,
    saved_s,
)
from coramp.metrics.motion import hard_brakings, stopped_vehicles
from coramp.records import Outcome
from coramp.scenario import Scenario

BOUND_FIGURES = (
    "delay_bound_s",
    "delay_bound_ratio",
    "mainline_fcfs_delay_s",
    "ramp_fcfs_delay_s",
    "lane_limit_veh_h",
)
LEAST_BOUND_S = 0.01
"""A ratio to less than this says nothing."""


def bound_figures(
    outcome: Outcome, scenario: Scenario, delay_s: FloatArray, free_flow_s: FloatArray
) -> dict[str, float | None]:
    """Returns the mean delay of all vehicles and what the lane allows; null for drivers.

    The bound holds for this run whatever its plans: where they brought a vehicle out earlier than
    its free movement, or two closer than h, that is granted.
    """
    mean_s = _known(float(np.mean(delay_s))) if len(delay_s) else None
    if not outcome.cooperative:
        return {"delay_s": mean_s, **dict.fromkeys(BOUND_FIGURES)}
    passages, rules = outcome.passages, scenario.rules()
    shortest_m = passages.length_m.min() if len(passages) else scenario.vehicle.length_m
    headway_s = lane_headway_s(float(shortest_m), rules)
    arrived = Arrived(passages.scheduled_s, passages.on_ramp, passages.entry_speed_mps, free_flow_s)
    earliest_s = quickest_exits_s(earliest_exits_s(*arrived[:3], packed(rules)), passages.exit_s)
    least_s = first_come_exits_s(earliest_s, headway_s, saved_s(headway_s, passages.exit_s))
    bound = delay_bound(arrived, least_s, outcome.end_s)
    ratio = mean_s / bound.all_s if mean_s is not None and bound.all_s >= LEAST_BOUND_S else None
    return {
        "delay_s": mean_s,
        "delay_bound_s": _known(bound.all_s),
        "delay_bound_ratio": ratio,
        "mainline_fcfs_delay_s": _known(bound.mainline_s),
        "ramp_fcfs_delay_s": _known(bound.ramp_s),
        "lane_limit_veh_h": lane_limit_veh_h(headway_s),
    }


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def braking_figures(outcome: Outcome, scenario: Scenario) -> dict[str, int]:
    """Returns how often vehicles braked hard, and how many stopped on their way, as driven."""
    passages, driven = outcome.passages, outcome.driven
    until_s = outcome.until_s
    return {
        "hard_brakings_3": int(hard_brakings(driven.first, driven.rows, until_s, 3.0)),
        "hard_brakings_4_5": int(hard_brakings(driven.first, driven.rows, until_s, 4.5)),
        "stops": int(
            stopped_vehicles(
                driven.first,
                driven.rows,
                until_s,
                passages.merge_s,
                scenario.ramp.acceleration_lane_m,
            )
        ),
    }
