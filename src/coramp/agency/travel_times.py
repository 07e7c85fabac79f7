"""Travel times of each stream: percentiles of all, and of who was due in each interval."""

from itertools import pairwise

import numpy as np
import polars as pl

from coramp._kernel import BoolArray
from coramp.agency.intervals import edges_of
from coramp.agency.motion import Motion
from coramp.agency.schemas import TRAVEL_TIMES
from coramp.metrics.queues import INTERVAL_S
from coramp.records.schemas import Row
from coramp.road.streams import STREAMS

PERCENTILES = (15, 50, 85, 95)


def travel_times_table(motion: Motion, interval_s: float = INTERVAL_S) -> pl.DataFrame:
    """Returns one row a stream, and one a stream and interval, with ``TRAVEL_TIMES``' columns.

    A travel time counts from when a vehicle was due, with its wait outside. Percentiles are of
    those that left the zone; the others are counted.
    """
    edges_s = edges_of(motion, interval_s)
    spans = [(0.0, float(edges_s[-1])), *pairwise(edges_s.tolist())]
    rows = []
    for on_ramp in (False, True):
        for place, (from_s, to_s) in enumerate(spans):
            due = (motion.scheduled_s >= from_s) & (motion.scheduled_s < to_s)
            own = (motion.on_ramp == on_ramp) & (due if place else True)
            rows.append(
                {"stream": STREAMS[on_ramp], "from_s": from_s, "to_s": to_s, **_of(motion, own)}
            )
    return pl.DataFrame(rows, schema=TRAVEL_TIMES)


def _of(motion: Motion, own: BoolArray) -> Row:
    through = own & motion.finished
    taken_s = (motion.exit_s - motion.scheduled_s)[through]
    found: Row = {
        "vehicles": int(own.sum()),
        "unserved": int(own.sum() - through.sum()),
        **dict.fromkeys(list(TRAVEL_TIMES)[5:]),
    }
    if not len(taken_s):
        return found
    free_s = float(motion.free_flow_s[through].mean())
    percentiles = np.percentile(taken_s, PERCENTILES).tolist()
    found.update(zip([f"p{p}_s" for p in PERCENTILES], percentiles, strict=True))
    return {
        **found,
        "free_flow_s": free_s,
        "mean_s": float(taken_s.mean()),
        "planning_time_index": found["p95_s"] / free_s,
    }
