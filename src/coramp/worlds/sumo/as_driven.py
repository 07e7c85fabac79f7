"""The outcome of a run as SUMO's positions have it, for whom nothing was planned."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.coordination.plant import Arrival
from coramp.metrics.motion import pieces_of_samples
from coramp.records.lanes import first_on_mainline_s, seen_history
from coramp.records.outcome import Outcome, Pieces, until_s
from coramp.road.lanes import MAINLINE, RAMP
from coramp.scenarios.model import Scenario
from coramp.vehicles.merge_state import BY_MAINLINE_S
from coramp.worlds.outcomes import cap_step_of, passages_of
from coramp.worlds.sumo.files import RunFiles, Samples


class Driving(NamedTuple):
    """Where SUMO's vehicles were, and which have left the road, one entry an arrival."""

    samples: Samples
    finished: BoolArray


def outcome_as_driven(
    scenario: Scenario,
    arrivals: Sequence[Arrival],
    driving: Driving,
    files: RunFiles,
    cut_off_s: float | None = None,
) -> Outcome:
    """Returns what happened: who passed when and how each drove, at SUMO's steps.

    ``cut_off_s`` is when SUMO was ended before everybody had left, if not at the scenario's end.
    """
    samples, step_s = driving.samples, scenario.control.step_s
    cap_s = cap_step_of(scenario) * step_s if cut_off_s is None else cut_off_s
    entry_s, exit_s = _passing_times(driving, scenario.mainline.end_m, step_s)
    first, rows = pieces_of_samples(*samples.motion, len(arrivals))
    left = not np.isnan(exit_s).any()
    no_plan = np.full(len(arrivals), np.nan)
    end_s = float(np.max(exit_s, initial=0.0)) if left else cap_s
    lanes = seen_history(samples.vehicle, samples.lane, samples.time_s, until_s(exit_s, end_s))
    merge_s = first_on_mainline_s(lanes, len(arrivals))
    merge_s[[not arrival.on_ramp for arrival in arrivals]] = BY_MAINLINE_S
    return Outcome(
        cooperative=False,
        passages=passages_of(arrivals, step_s, entry_s, merge_s, exit_s, no_plan),
        pieces=Pieces(first, rows),
        lane=np.where(samples.on_mainline, MAINLINE + samples.lane, RAMP),
        driven=Pieces(first, rows),
        lanes=lanes,
        end_s=end_s,
        collisions=files.collisions(),
        collided=files.collided(arrivals),
    )


def _passing_times(driving: Driving, end_m: float, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Entry and exit of each vehicle; its last sample is run on to the zone's end."""
    samples, finished = driving
    entry_s, exit_s = (np.full(len(finished), np.nan) for _ in range(2))
    seen, first = np.unique(samples.vehicle, return_index=True)
    last = np.append(first[1:], len(samples.vehicle))[: len(first)] - 1
    entry_s[seen] = samples.time_s[first]
    left_m = end_m - samples.station_m[last]
    run_on_s = np.minimum(left_m / np.maximum(samples.speed_mps[last], 1e-9), step_s)
    exit_s[seen] = samples.time_s[last] + run_on_s
    return entry_s, np.where(finished, exit_s, np.nan)
