"""From a scenario and a file of counts to a population of drivers."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from coramp.calibration.calibrate import Calibrated, calibrate_series
from coramp.calibration.effort import Effort
from coramp.calibration.models import model_checked
from coramp.calibration.series import series_of
from coramp.calibration.site import site_of
from coramp.calibration.written import Provenance, sha256_of
from coramp.counts.reading import read_counts
from coramp.counts.table import Counts
from coramp.errors import CorampError
from coramp.metrics.queues import INTERVAL_S
from coramp.scenarios.loading import load_scenario

LONGEST_S = 3.0 * INTERVAL_S


@dataclass(frozen=True)
class Asked:
    """What is to be calibrated: by which model, how much, with which keys of the scenario set.

    ``date`` is only noted. With ``repair`` counts that do not add up are mended where possible.
    """

    model: str = "krauss"
    overrides: Mapping[str, Any] | None = None
    repair: bool = False
    date: str = ""


def calibrated(
    scenario: str, counts: Path, asked: Asked, effort: Effort
) -> tuple[Calibrated, Provenance]:
    """Returns the population that fits a file of counts best on a scenario's road, and its origin.

    The scenario says where the detectors of the file lie: each needs a ``[[detector]]`` of its id.
    Raises CorampError for counts that do not add up or are too few, and for detectors that are
    missing or not on the road.
    """
    model = model_checked(asked.model)
    loaded = load_scenario(scenario, asked.overrides)
    read = read_counts(counts, asked.repair, loaded.mainline.lanes)
    known = [loop for loop in loaded.detector if loop.id in read.detectors]
    if not known:
        ids = ", ".join(loop.id for loop in loaded.detector) or "none"
        raise CorampError(
            f"{counts}: its detectors {', '.join(read.detectors)} are none of the scenario's; "
            f"{scenario} has {ids}: allowed is a [[detector]] of each id"
        )
    try:
        site = site_of(known, loaded.ramp.acceleration_lane_m)
        data = series_of(_whole(read, [loop.id for loop in known]))
        found = calibrate_series(loaded, site, data, model, effort)
    except CorampError as error:
        raise CorampError(*(f"{counts}: {line}" for line in error.messages)) from error
    origin = Provenance(
        counts.name, sha256_of(counts), loaded.name, model, effort.runs, effort.seeds, asked.date
    )
    return found, origin


def _whole(counts: Counts, detectors: list[str]) -> pl.DataFrame:
    """The rows of some detectors in whole intervals: the last one of a file may be shorter."""
    if counts.interval_s > LONGEST_S:
        raise CorampError(
            f"intervals of {counts.interval_s:g} s are too long to see a breakdown in; allowed are "
            f"60 to {LONGEST_S:g} s"
        )
    long = (pl.col("end_s") - pl.col("begin_s")) > counts.interval_s - 1e-6
    return counts.frame.filter(long, pl.col("detector").is_in(detectors))
