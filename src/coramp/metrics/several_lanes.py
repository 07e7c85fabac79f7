"""Figures of roads with several mainline lanes: who made way, and what the outermost lane got."""

import numpy as np

from coramp._kernel import FloatArray
from coramp.records.lanes import LaneHistory
from coramp.records.outcome import Outcome
from coramp.records.schemas import LANE_METRICS, Row
from coramp.scenarios.model import Scenario


def several_lanes_figures(outcome: Outcome, scenario: Scenario, delay_s: FloatArray) -> Row:
    """Returns the figures of a road with several lanes; null on a road of one lane.

    ``made_way`` is of automated vehicles alone, as all are that have plans, which change lanes on
    the mainline for nothing else; it is null where nobody is automated.
    """
    if scenario.mainline.lanes == 1:
        return dict.fromkeys(LANE_METRICS)
    passages = outcome.passages
    outer = ~passages.on_ramp & (passages.lane == 0)
    changed = changed_further_in(outcome.lanes)
    automated = np.ones(len(passages), np.bool_) if outcome.cooperative else passages.automated
    return {
        "outer_lane_delay_s": float(delay_s[outer].mean()) if outer.any() else None,
        "made_way": None if automated is None else int(automated[changed].sum()),
    }


def changed_further_in(lanes: LaneHistory) -> np.ndarray:
    """Returns whose stay in a lane of the mainline began by a change from the one further out.

    A vehicle stands there once for each such change.
    """
    vehicle, lane = lanes.vehicle, lanes.lane
    order = np.lexsort((lanes.from_s, vehicle))
    vehicle, lane = vehicle[order], lane[order]
    same = vehicle[1:] == vehicle[:-1]
    further_in = same & (lane[:-1] >= 0) & (lane[1:] == lane[:-1] + 1)
    return np.asarray(vehicle[1:][further_in])
