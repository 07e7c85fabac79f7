"""Who arrives, as detectors where vehicles enter have counted."""

import numpy as np

from coramp._kernel import FloatArray
from coramp.coordination.plant import Arrival
from coramp.demand.arrivals import generator
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario


def times_of_counts_s(
    counts: FloatArray, interval_s: float, min_headway_s: float, random: np.random.Generator
) -> FloatArray:
    """Returns times (s) within successive intervals, as many in each as were counted.

    Times are drawn uniformly such that within an interval nobody follows at less than
    ``min_headway_s``, or at less than 90 % of the mean headway where that is shorter.
    """
    found = []
    for k, count in enumerate(counts.astype(np.int64).tolist()):
        headway_s = min(min_headway_s, 0.9 * interval_s / max(1, count))
        free_s = interval_s - headway_s * count
        places_s = np.sort(random.random(count)) * free_s + headway_s * np.arange(count)
        found.append(k * interval_s + places_s)
    return np.concatenate(found) if found else np.empty(0)


def saturated(counts: FloatArray, congested: FloatArray) -> FloatArray:
    """Returns counts with those of a queue at the detector raised to the last count without one.

    A detector that stands in a queue counts what the merge lets through and not who would come.
    """
    result, last = counts.copy(), 0.0
    for k in range(len(counts)):
        if congested[k]:
            result[k] = max(result[k], last)
        else:
            last = float(np.mean(counts[max(0, k - 2) : k + 1].round()))
    return np.rint(result)


def arrivals_of_counts(
    scenario: Scenario,
    counts: tuple[FloatArray, FloatArray],
    interval_s: float,
    lead_s: tuple[float, float],
    seed: int,
) -> list[Arrival]:
    """Returns arrivals of both streams, mainline and ramp, as counted in successive intervals.

    ``lead_s`` is added to times of either stream: from the first interval's begin to its arrival at
    the start of the road.
    """
    step_s = scenario.control.step_s
    found = []
    for on_ramp, stream in enumerate((scenario.mainline, scenario.ramp)):
        random = generator(seed, f"arrivals/{STREAMS[on_ramp]}")
        times_s = times_of_counts_s(counts[on_ramp], interval_s, stream.min_headway_s, random)
        low_mps, high_mps = stream.entry_speed_mps
        own = generator(seed, f"entry speeds/{STREAMS[on_ramp]}")
        speeds_mps = own.uniform(low_mps, high_mps, len(times_s))
        steps = np.maximum(0, np.rint((times_s + lead_s[on_ramp]) / step_s)).astype(np.int64)
        found += [(step, bool(on_ramp), mps) for step, mps in zip(steps, speeds_mps, strict=True)]
    found.sort()
    numbers = [0, 0]
    arrivals = []
    length_m = scenario.vehicle_types[0].length_m
    for step, on_ramp, mps in found:
        numbers[on_ramp] += 1
        name = f"{'mr'[on_ramp]}{numbers[on_ramp]:05d}"
        arrivals.append(Arrival(name, on_ramp, int(step), float(mps), length_m))
    return arrivals
