"""What a study still has to do, and how long that should take."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from coramp.records.schemas import Row
from coramp.runs.corridors import CorridorSpec
from coramp.strategies.registry import strategy_named
from coramp.studies.breakdown import Bisection
from coramp.studies.runner import AnySpec
from coramp.studies.store import Store

SECONDS_PER_VEHICLE = {
    ("exact", False): 5e-5,
    ("sumo", False): 8e-4,
    ("sumo", True): 2e-3,
    ("corridor", False): 8e-3,
    ("corridor", True): 1.5e-2,
}
"""By engine, and whether drivers drive, or on a corridor whether vehicles are coordinated: of runs
on the machine of docs/performance.md."""


@dataclass(frozen=True)
class Outlook:
    """How far a study is.

    ``searches_at_most`` counts the runs that searches for a breakdown may add; which ones they
    are, and how many, follows from the results. ``expected_s`` is for the runs to do, on ``jobs``
    processes, without compiling: what a strategy's first run on a machine takes more. ``outdated``
    counts runs that are kept of the scenario as it was before its file was changed.
    """

    folder: Path
    runs: int
    done: int
    failed: int
    damaged: int
    searches_at_most: int
    jobs: int
    expected_s: float
    outdated: int = 0

    @property
    def missing(self) -> int:
        """Runs to do, damaged and failed ones too, without those of searches."""
        return self.runs - self.done


def outlook_of(
    store: Store | None,
    folder: Path,
    specs: Sequence[AnySpec],
    searches: Sequence[Bisection],
    jobs: int,
) -> Outlook:
    """Returns the outlook of a study; ``store`` is None where nothing was begun.

    What a search may still take is reckoned at the middle of its range.
    """
    failed: set[str] = set()
    damaged: set[str] = set()

    def result_of(spec: AnySpec) -> Row | None:
        part = store.stored(spec) if store is not None else None
        if part is None:
            if store is not None and store.is_damaged(spec):
                damaged.add(spec.run_id)
            return None
        if part.run["status"] != "ok":
            failed.add(spec.run_id)
            return None
        return part.run

    seen: dict[tuple[str, bool], list[float]] = defaultdict(list)
    missing: list[AnySpec] = []
    likely: list[AnySpec] = []
    done = 0
    walks = [search.so_far(result_of) for search in searches]
    asked = (*specs, *(spec for taken, _ in walks for spec in taken))
    for spec in {s.run_id: s for s in asked}.values():
        run = result_of(spec)
        if run is None:
            missing.append(spec)
            continue
        done += 1
        seen[_kind(spec)].append(run["wall_s"] / max(1.0, _vehicles(spec)))
    for search, (_, left) in zip(searches, walks, strict=True):
        likely += [search.spec_at(search.search.steps // 2)] * left
    per_vehicle_s = {**SECONDS_PER_VEHICLE, **{kind: median(s) for kind, s in seen.items()}}
    expected_s = sum(per_vehicle_s[_kind(s)] * _vehicles(s) for s in (*missing, *likely)) / jobs
    runs = done + len(missing)
    changed = store is not None and store.scenario_changed
    outdated = store.count_of_others(asked) if store is not None and changed else 0
    counts = (runs, done, len(failed), len(damaged), len(likely), jobs)
    return Outlook(folder, *counts, expected_s, outdated)


def _kind(spec: AnySpec) -> tuple[str, bool]:
    if isinstance(spec, CorridorSpec):
        return "corridor", strategy_named(spec.strategy).cooperative
    return spec.engine, spec.drivers is not None


def _vehicles(spec: AnySpec) -> float:
    if isinstance(spec, CorridorSpec):
        flow_veh_h = float(spec.keys["mainline_veh_h"]) + float(spec.keys["ramp_veh_h"])
        return flow_veh_h * spec.corridor.common.simulation.horizon_s / 3600.0
    scenario = spec.scenario
    streams = (scenario.mainline, scenario.ramp)
    flow_veh_h = sum(0.5 * sum(stream.flows_veh_h) for stream in streams)
    return max(float(len(scenario.arrivals)), flow_veh_h * scenario.simulation.horizon_s / 3600.0)
