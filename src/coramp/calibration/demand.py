"""Who comes, where detectors count only who gets through, and when within an interval."""

from collections.abc import Iterator

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.demand.arrivals import kinds_of
from coramp.demand.generators import generator
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import ExplicitArrival, Vehicle

BEFORE = 3
"""Over so many intervals demand before a queue is averaged."""


def saturated(counts: FloatArray, queue: BoolArray) -> FloatArray:
    """Returns counts (whole numbers) with those of a queue at the detector raised.

    A detector that stands in a queue counts what the merge lets through and not who would come:
    that is taken to be what came in the last intervals without a queue, or what was counted where
    that is more.
    """
    result = counts.copy()
    for k in np.flatnonzero(queue):
        free = np.flatnonzero(~queue[:k])[-BEFORE:]
        if len(free):
            result[k] = max(counts[k], counts[free].mean())
    return np.rint(result)


def arrivals_by_counts(
    scenario: Scenario, on_ramp: bool, begins_s: FloatArray, counts: FloatArray, seed: int
) -> Iterator[ExplicitArrival]:
    """Yields the vehicles of a stream that enter in intervals of equal length.

    As many come in each as ``counts`` says, on each lane with its share as probability. Any times
    that keep the least headway are equally likely, so that there are platoons as on roads without a
    signal. That of counts as a scenario's demand is smoother: its vehicles enter undisturbed.
    """
    stream = scenario.ramp if on_ramp else scenario.mainline
    shares = (1.0,) if on_ramp else scenario.mainline.shares
    name, interval_s = STREAMS[on_ramp], float(begins_s[1] - begins_s[0])
    random = generator(seed, f"arrivals by counts/{name}")
    lanes = random.multinomial(counts.astype(np.int64), shares)
    step_s = scenario.control.step_s
    for lane, own in enumerate(lanes.T.tolist()):
        kinds = iter(_types(scenario, on_ramp, sum(own), seed, f"{name}/lane {lane}"))
        last = -1
        for begin_s, count in zip(begins_s.tolist(), own, strict=True):
            least_s = min(stream.min_headway_s, interval_s / max(1, count))
            free_s = np.sort(random.random(count)) * (interval_s - count * least_s)
            times_s = begin_s + free_s + least_s * np.arange(count)
            speeds_mps = random.uniform(*stream.entry_speed_mps, count)
            for time_s, speed_mps in zip(times_s.tolist(), speeds_mps.tolist(), strict=True):
                last = max(last + 1, int(time_s / step_s))
                kind, top_mps = next(kinds)
                yield ExplicitArrival(
                    stream="ramp" if on_ramp else "mainline",
                    time_s=last * step_s,
                    speed_mps=speed_mps,
                    type=kind,
                    top_speed_mps=top_mps,
                    lane=lane,
                )


def _types(
    scenario: Scenario, on_ramp: bool, count: int, seed: int, of_lane: str
) -> list[tuple[str | None, float | None]]:
    """Names and top speeds (m/s) of types by their shares, None where all are alike."""
    if isinstance(scenario.vehicle, Vehicle):
        return [(None, None)] * count
    return [
        (kind.name, top_mps if np.isfinite(top_mps) else None)
        for kind, top_mps in kinds_of(scenario, on_ramp, count, seed, of_lane)
    ]
