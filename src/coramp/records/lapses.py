"""When vehicles drove in fallback, or nobody knew of them: spans of time from what was heard."""

from typing import NamedTuple

import numpy as np
import polars as pl

FALLBACK, UNKNOWN = "fallback", "unknown"
USUAL_PERIOD_S = 0.2


class Lapse(NamedTuple):
    """A vehicle was in a state from ``from_s`` until ``until_s``: ``fallback`` or ``unknown``."""

    vehicle_id: str
    what: str
    from_s: float
    until_s: float


def period_s(heard: pl.DataFrame) -> float:
    """Returns the time (s) between two decisions, from the times of a table of what was heard."""
    times_s = heard["time_s"].unique().sort().to_numpy()
    return float(np.diff(times_s).min()) if len(times_s) > 1 else USUAL_PERIOD_S


def lapses_in(heard: pl.DataFrame | None) -> list[Lapse]:
    """Returns all fallbacks and all times in which a vehicle was not known, by when they begin."""
    if heard is None:
        return []
    step_s = period_s(heard)
    states = {FALLBACK: pl.col("fallback"), UNKNOWN: pl.col("station_m").is_null()}
    found = [
        Lapse(name, what, float(from_s), float(last_s) + step_s)
        for what, state in states.items()
        for name, _, from_s, last_s in heard.filter(state)
        .sort("vehicle_id", "time_s")
        .with_columns(
            span=(pl.col("time_s").diff().fill_null(0.0) > 1.5 * step_s)
            .cum_sum()
            .over("vehicle_id")
        )
        .group_by("vehicle_id", "span", maintain_order=True)
        .agg(first=pl.col("time_s").min(), last=pl.col("time_s").max())
        .iter_rows()
    ]
    return sorted(found, key=lambda lapse: (lapse.from_s, lapse.vehicle_id, lapse.what))
