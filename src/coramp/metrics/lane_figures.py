"""How near a run came to what its lane allows, and how roughly its vehicles drove."""

import math

import numpy as np

from coramp._kernel import FloatArray
from coramp.metrics.delay_bound import (
    Arrived,
    earliest_exits_s,
    first_come_exits_s,
    lane_headway_s,
    lane_limit_veh_h,
    mean_delays,
    quickest_exits_s,
    saved_s,
)
from coramp.metrics.motion import hard_brakings, stopped_vehicles
from coramp.records.outcome import Outcome
from coramp.road.rules import packed
from coramp.scenarios.model import Scenario

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

    It is null as well where vehicles differ in more than their lengths, and where the mainline has
    several lanes: the bound is one for equal vehicles on one lane.

    The streams' delays first come, first served, are those of the arrivals alone. The bound holds
    for this run whatever its plans: where they brought a vehicle out earlier than its free
    movement, or two closer than h, that is granted.
    """
    mean_s = _known(float(np.mean(delay_s))) if len(delay_s) else None
    one_lane = scenario.mainline.lanes == 1
    if not outcome.cooperative or scenario.vehicles_differ or not one_lane:
        return {"delay_s": mean_s, **dict.fromkeys(BOUND_FIGURES)}
    passages, rules = outcome.passages, scenario.rules()
    shortest_m = passages.length_m.min() if len(passages) else scenario.usual_length_m
    headway_s = lane_headway_s(float(shortest_m), rules)
    arrived = Arrived(passages.scheduled_s, passages.on_ramp, passages.entry_speed_mps, free_flow_s)
    earliest_s = earliest_exits_s(*arrived[:3], packed(rules))
    served = mean_delays(arrived, first_come_exits_s(earliest_s, headway_s))
    quickest_s = quickest_exits_s(earliest_s, passages.exit_s)
    saved = saved_s(headway_s, passages.exit_s)
    least_s = np.minimum(first_come_exits_s(quickest_s, headway_s, saved), outcome.end_s)
    bound_s = mean_delays(arrived, least_s).all_s
    return {
        "delay_s": mean_s,
        "delay_bound_s": _known(bound_s),
        "delay_bound_ratio": mean_s / bound_s if mean_s and bound_s >= LEAST_BOUND_S else None,
        "mainline_fcfs_delay_s": _known(served.mainline_s),
        "ramp_fcfs_delay_s": _known(served.ramp_s),
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
