"""How sure the figures of a study are."""

from collections.abc import Iterator

import polars as pl

from coramp.report.page.study_answer import answered_differences
from coramp.studies.summary import promises

FEW_SEEDS = 10
SHORT_S = 1800.0
"""Fewer seeds, or a shorter horizon (s), are told."""


def of_differences(good: pl.DataFrame) -> Iterator[str]:
    """Returns how sure the differences are that ``own_answer`` tells, if it tells any."""
    found = answered_differences(good)
    if found:
        unsure = sum(not difference.told_apart for difference in found)
        sure = (
            "The intervals of all differences in the answer exclude zero."
            if not unsure
            else f"The intervals of {unsure} of the {len(found)} differences in the answer hold "
            "zero: these may be chance."
        )
        yield (
            "Differences are taken seed by seed on the same arrivals, so they are surer than the "
            f"means, whose intervals may overlap. {sure}"
        )


def of_little(seeds: int, horizon_s: float) -> Iterator[str]:
    """Returns that seeds are few or the horizon (s) is short, where that is so."""
    few = [f"{seeds} seeds"] if 1 < seeds < FEW_SEEDS else []
    short = [f"{horizon_s:g} s of arrivals a run"] if horizon_s < SHORT_S else []
    if few or short:
        yield (
            f"There are {' and '.join(few + short)}, which is little: for a claim take at least "
            f"{FEW_SEEDS} seeds and {SHORT_S:g} s. Queues that grow slowly show only then."
        )


def how_sure(good: pl.DataFrame, horizon_s: float, *, compared: bool, listed: bool) -> list[str]:
    """Returns how sure a study's figures are, in lines; its horizon is in s.

    ``compared`` says whether its answer has differences, ``listed`` whether its scenario lists its
    arrivals.
    """
    kept = promises(good)
    seeds = good["seed"].n_unique()
    alone = " One seed has none; run more (--seeds 10)." if seeds == 1 else ""
    if listed:
        means = (
            "Arrivals are listed: a seed changes drivers alone, and a cooperative run is the same "
            "with every seed. It runs once, so that it has no interval."
        )
    else:
        means = (
            f"Means are over {seeds} seeds, each one draw of arrivals and entry speeds, the same "
            f"for every strategy; ± is a 95 % interval of the mean by Student's t.{alone}"
        )
    return [
        means,
        *(of_differences(good) if compared else ()),
        *(() if listed else of_little(seeds, horizon_s)),
        "What the cooperative runs promised: "
        + "; ".join(f"{what}: {value}" for what, value in kept.rows)
        + ".",
    ]
