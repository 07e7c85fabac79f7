"""What the coordinator knew and what was lost, as a page shows it: at vehicles and over time."""

from collections.abc import Mapping

import numpy as np
import polars as pl

from coramp.mixed.laws import FollowingLaw, SafetyLaw
from coramp.records.lapses import period_s
from coramp.records.run import RunRecords
from coramp.records.schemas import Row

FALLBACK, UNKNOWN, REPORT_LOST, COMMAND_LOST, ON_MAINLINE = 1, 2, 4, 8, 16
"""Bits of a row's last number."""
ERROR_M, AGE_S = 0.3, 0.3
"""A row whose error and age are this near to those of the last row kept is left out."""


def heard_data(run: RunRecords, place_of: Mapping[str, int], end_s: float) -> Row | None:
    """Returns what was known of vehicles when, None where nothing was kept.

    ``rows`` are time (s), error (m), age (s) and bits, one after the other; those of vehicle i are
    ``first[i]`` to ``first[i + 1]``. Each holds until the next; 0 bits: known as it is. ``counts``
    has one entry a second: messages lost in it, and most vehicles at once that fell back or were
    not known.
    """
    heard = run.heard
    if heard is None:
        return None
    step_s = period_s(heard)
    marked = heard.with_columns(
        place=pl.col("vehicle_id").replace_strict(place_of, return_dtype=pl.Int64), bits=_bits()
    ).sort("place", "time_s")
    first, rows = [0], list[float]()
    by_place = {key[0]: frame for key, frame in marked.partition_by("place", as_dict=True).items()}
    for place in range(len(place_of)):
        rows += _rows_of(by_place[place], step_s) if place in by_place else []
        first.append(len(rows) // 4)
    law = SafetyLaw().on(run.scenario.road.assumed_braking_mps2)
    return {
        "first": first,
        "rows": rows,
        "counts": _counts(heard, int(end_s) + 1),
        "noise_m": run.scenario.positioning.noise_m,
        "brakes_mps2": law.braking_mps2,
        "speeds_up_mps2": FollowingLaw().speed_up_mps2,
        "stale_s": run.scenario.reports.stale_s,
        "valid_s": run.scenario.commands.valid_s,
    }


def _bits() -> pl.Expr:
    bits = {
        FALLBACK: pl.col("fallback"),
        UNKNOWN: pl.col("station_m").is_null(),
        REPORT_LOST: pl.col("report_lost"),
        COMMAND_LOST: pl.col("command_lost"),
        ON_MAINLINE: (pl.col("lane") == "mainline").fill_null(value=False),
    }
    return pl.sum_horizontal(*(flag.cast(pl.Int64) * bit for bit, flag in bits.items()))


def _rows_of(own: pl.DataFrame, step_s: float) -> list[float]:
    """The rows of one vehicle that tell something new, and where all is known again."""
    kept = list[float]()
    columns = own.select("time_s", pl.col("error_m", "age_s").fill_null(0.0), "bits")
    last, ends_s = (0.0, 0.0, 0.0, 0), -1.0
    for time_s, error_m, age_s, bits in columns.iter_rows():
        after_a_gap = time_s > ends_s + 0.5 * step_s
        if after_a_gap and ends_s >= 0.0:
            kept += [round(ends_s, 3), 0, 0, 0]
        differs = abs(error_m - last[1]) > ERROR_M or abs(age_s - last[2]) >= AGE_S
        if after_a_gap or differs or bits != last[3]:
            kept += [round(time_s, 3), round(error_m, 2), round(age_s, 2), bits]
            last = (time_s, error_m, age_s, bits)
        ends_s = time_s + step_s
    return [*kept, round(ends_s, 3), 0, 0, 0]


def _counts(heard: pl.DataFrame, seconds: int) -> dict[str, list[int]]:
    """By second: reports and commands lost in it, and most vehicles at once that were in a state.

    There is one entry a second of the run.
    """
    each = heard.group_by("time_s").agg(
        pl.col("report_lost", "command_lost", "fallback").sum(),
        unknown=pl.col("station_m").is_null().sum(),
    )
    lost, most = ("report_lost", "command_lost"), ("fallback", "unknown")
    binned = (
        each.group_by(second=pl.col("time_s").cast(pl.Int64))
        .agg(pl.col(*lost).sum(), pl.col(*most).max())
        .filter(pl.col("second") < seconds)
    )
    counts = {}
    for name in (*lost, *most):
        values = np.zeros(seconds, np.int64)
        values[binned["second"].to_numpy()] = binned[name].to_numpy()
        counts[name] = values.tolist()
    return counts
