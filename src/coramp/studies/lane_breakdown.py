"""Where the lane itself breaks down: the flow at which the least mean delay passes 5 s.

On the same arrivals as a study's searches, by bisection between the same flows, without any run.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import polars as pl

from coramp.demand.arrivals import arrivals_of
from coramp.metrics.delay_bound import (
    Arrived,
    earliest_exits_s,
    first_come_exits_s,
    lane_headway_s,
    mean_delays,
)
from coramp.road.rules import packed
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.model import Scenario
from coramp.studies.breakdown import BREAKDOWN_DELAY_S
from coramp.studies.overrides import overrides_of

Key = tuple[str, str, float, int]
"""Scenario, overrides, ramp flow (veh/h) and seed."""


def lane_flows_veh_h(good: pl.DataFrame, horizon_s: float | None) -> dict[Key, float]:
    """Returns at which mainline flow (veh/h) the bound breaks down, by what was searched.

    For each combination of cooperative runs; infinity where the highest flow tried does not.
    """
    cooperative = good.filter(pl.col("drivers").is_null())
    flows = sorted(good["mainline_veh_h"].unique().to_list())
    if cooperative.is_empty() or len(flows) < 2:
        return {}
    resolution = min(b - a for a, b in pairwise(flows))
    steps = round((flows[-1] - flows[0]) / resolution)
    keys = cooperative.select("scenario", "overrides", "settings", "ramp_veh_h", "seed").unique()
    found: dict[Key, float] = {}
    for scenario, overrides, settings, ramp, seed in keys.iter_rows():
        setting = (scenario, settings, horizon_s, ramp, seed)
        low, high = -1, steps + 1
        while high - low > 1:
            middle = (low + high) // 2
            flow = flows[0] + middle * resolution
            if least_delay_s(*setting, flow) > BREAKDOWN_DELAY_S:
                high = middle
            else:
                low = middle
        key = (scenario, overrides or "", ramp, seed)
        found[key] = flows[0] + high * resolution if high <= steps else float("inf")
    return found


@cache
def least_delay_s(
    name: str,
    overrides_json: str | None,
    horizon_s: float | None,
    ramp_veh_h: float,
    seed: int,
    mainline_veh_h: float,
) -> float:
    """Returns the mean delay (s) of all that no plan can beat, from the arrivals alone.

    ``overrides_json`` is what the column ``settings`` of ``runs.parquet`` holds.
    """
    settings = {
        key: value
        for key, value in overrides_of({"settings": overrides_json}).items()
        if not key.startswith("strategy.")  # of no effect on who arrives, nor on the lane
    }
    settings["mainline.flow_veh_h"], settings["ramp.flow_veh_h"] = mainline_veh_h, ramp_veh_h
    if horizon_s is not None:
        settings["simulation.horizon_s"] = horizon_s
    return mean_bound_s(load_scenario(name, settings), seed)


def mean_bound_s(scenario: Scenario, seed: int) -> float:
    """Returns the bound (s) on the mean delay of all arrivals of a seed."""
    arrivals, step_s = arrivals_of(scenario, seed), scenario.control.step_s
    if not arrivals:
        return 0.0
    on_ramp = np.array([a.on_ramp for a in arrivals], np.bool_)
    arrived = Arrived(
        np.array([a.step * step_s for a in arrivals]),
        on_ramp,
        np.array([a.speed_mps for a in arrivals]),
        np.where(on_ramp, scenario.ramp_free_flow_s, scenario.mainline_free_flow_s),
    )
    rules = scenario.rules()
    earliest_s = earliest_exits_s(*arrived[:3], packed(rules))
    headway_s = lane_headway_s(min(a.length_m for a in arrivals), rules)
    return mean_delays(arrived, first_come_exits_s(earliest_s, headway_s)).all_s
