"""What the study of baselines asks of its runs: settings, groups, delays."""

from typing import Any

import polars as pl

from coramp.scenarios.loading import load_scenario
from coramp.studies.overrides import overrides_of
from coramp.studies.statistics import Estimate, estimate
from coramp.studies.tables import with_interval

LANE = "ramp.acceleration_lane_m"
GAP = "safety.time_gap_s"
STANDSTILL = "safety.standstill_gap_m"
FLOW = ["mainline_veh_h", "ramp_veh_h"]
MARKED = "u: vehicles that were not out at the end; c: collisions that SUMO saw; over all seeds."

Flow = tuple[float, float]


def with_settings(good: pl.DataFrame) -> pl.DataFrame:
    """Returns runs with a column ``said``, as ``settings_of`` finds them."""
    found = [settings_of(run) for run in good.iter_rows(named=True)]
    return good.with_columns(said=pl.Series(found, dtype=pl.Object))


def settings_of(run: dict[str, Any]) -> dict[str, Any]:
    """Returns what a run's overrides say, and the scenario's own values for the rest.

    Those of its population of drivers go by their last name, as ``sigma``.
    """
    scenario = load_scenario(run["scenario"])
    found: dict[str, Any] = {
        LANE: scenario.ramp.acceleration_lane_m,
        GAP: scenario.safety.time_gap_s,
        STANDSTILL: scenario.safety.model_dump().get("standstill_gap_m", 0.0),
    }
    if run["drivers"] is not None:
        found.update(scenario.drivers[run["drivers"]].model_dump())
    return {**found, **_set_in(run)}


def _set_in(run: dict[str, Any]) -> dict[str, Any]:
    own = f"drivers.{run['drivers']}."
    return {key.removeprefix(own): value for key, value in overrides_of(run).items()}


def matching(runs: pl.DataFrame, **wanted: Any) -> pl.DataFrame:
    """Returns the runs with these settings; lane, gap and standstill are those of the road."""
    keys = {"lane": LANE, "gap": GAP, "standstill": STANDSTILL}
    kept = [
        all(settings.get(keys.get(k, k)) == v for k, v in wanted.items())
        for settings in runs["said"].to_list()
    ]
    return runs.filter(pl.Series(kept, dtype=pl.Boolean))


def set_only(runs: pl.DataFrame, *keys: str) -> pl.DataFrame:
    """Returns the runs in which nothing but these keys was set."""
    kept = [_set_in(run).keys() <= set(keys) for run in runs.iter_rows(named=True)]
    return runs.filter(pl.Series(kept, dtype=pl.Boolean))


def flows_of(runs: pl.DataFrame) -> list[Flow]:
    """Returns the flows of some runs, in order."""
    return sorted(runs.select(FLOW).unique().iter_rows())


def estimates(runs: pl.DataFrame, column: str) -> dict[Flow, Estimate]:
    """Returns the mean over seeds of a column, by flow."""
    return {
        (float(key[0]), float(key[1])): estimate(group[column].drop_nulls().to_list())
        for key, group in runs.group_by(FLOW, maintain_order=True)
    }


def delays(own: pl.DataFrame, flows: list[Flow]) -> list[str]:
    """Returns mean delays of mainline / ramp (s) by flow, a dash where there are no runs."""
    mainline, ramp = estimates(own, "mainline_delay_s"), estimates(own, "ramp_delay_s")
    cells = []
    for flow in flows:
        if flow not in mainline:
            cells.append("-")
            continue
        text = f"{with_interval(mainline[flow])} / {with_interval(ramp[flow])}"
        cells.append(text + marks(own, flow))
    return cells


def marks(own: pl.DataFrame, flow: Flow) -> str:
    """What a delay must not be read without: who was not out at the end, and who collided."""
    there = own.filter(mainline_veh_h=flow[0], ramp_veh_h=flow[1])
    counts = (("u", there["unserved"].sum()), ("c", there["collisions"].sum()))
    return "".join(f", {mark} {count}" for mark, count in counts if count)
