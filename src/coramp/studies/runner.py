"""Runs what a study still lacks, on all cores, and keeps every result as it comes."""

import os
import time
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from coramp.errors import CorampError
from coramp.records.schemas import Row
from coramp.runs.corridor_rows import corridor_row, failed_corridor_row, site_rows
from coramp.runs.corridors import CorridorSpec, execute_corridor
from coramp.runs.running import RunSpec, execute, failed_row
from coramp.studies.breakdown import Bisection
from coramp.studies.definition import sort_key
from coramp.studies.store import Part, Store

ALL_WORKERS = -1
"""As a number of jobs: whatever the cluster has."""
DEATHS_BEFORE_ISOLATION = 3
"""How often workers may die before each remaining run gets a worker of its own."""


@dataclass(frozen=True)
class Progress:
    """How far a study is; ``damaged`` parts were found and are run again."""

    total: int
    done: int
    skipped: int
    failed: int
    damaged: int
    last: Part | None = None


AnySpec = RunSpec | CorridorSpec
"""A run of one merge site, or of a corridor of several."""


def execute_part(spec: AnySpec) -> Part:
    """Returns the part of one run, a failed one too: what goes wrong stays in its own row."""
    started = time.perf_counter()
    try:
        return _corridor_part(spec) if isinstance(spec, CorridorSpec) else _part(spec)
    except CorampError as error:
        text = "; ".join(error.messages)
    except Exception as error:  # noqa: BLE001 - a bug in one run must not take the study down
        text = f"{type(error).__name__}: {error}"
    return _failed(spec, text, time.perf_counter() - started)


def _failed(spec: AnySpec, error: str, wall_s: float) -> Part:
    if isinstance(spec, CorridorSpec):
        return Part(failed_corridor_row(spec, error, wall_s), [])
    return Part(failed_row(spec, error, wall_s), [])


def _corridor_part(spec: CorridorSpec) -> Part:
    result = execute_corridor(spec)
    return Part(corridor_row(spec, result), site_rows(spec, result))


def _part(spec: RunSpec) -> Part:
    tables, row = execute(spec)
    flows = {
        "mainline": spec.scenario.mainline.flow_veh_h,
        "ramp": spec.scenario.ramp.flow_veh_h,
    }
    streams = [
        {"run_id": spec.run_id, "flow_veh_h": float(flows[s["stream"]]), **s}
        for s in tables.streams
    ]
    return Part(row, streams)


def run_missing(
    store: Store, specs: Sequence[AnySpec], jobs: int, report: Callable[[Progress], None]
) -> None:
    """Runs what the store lacks of the given runs, and keeps each result as it comes.

    ``report`` is called at the start and after every run. ``jobs`` counts processes of this
    machine; within ``cluster.connected`` the cluster's workers run instead.
    """
    missing = [spec for spec in specs if store.read(spec) is None]
    damaged = sum(store.is_damaged(spec) for spec in missing)
    skipped = len(specs) - len(missing)
    failed = 0
    report(Progress(len(specs), 0, skipped, 0, damaged))
    with _quietly_closed(_results(missing, jobs)) as results:
        for done, (spec, part) in enumerate(results, 1):
            store.write(spec, part)
            failed += part.run["status"] == "failed"
            report(Progress(len(specs), done, skipped, failed, damaged, part))


Results = Generator[tuple[AnySpec, Part], None, None]


@contextmanager
def _quietly_closed(results: Results) -> Iterator[Results]:
    """Gives up what is under way where a study stops, without joblib's warnings.

    It warns of tasks that are given up, and of workers that it replaces since their memory grew.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "[0-9]+ tasks", UserWarning)
        warnings.filterwarnings("ignore", "A worker stopped", UserWarning)
        try:
            yield results
        finally:
            results.close()


def run_searches(
    store: Store,
    searches: Sequence[Bisection],
    jobs: int,
    report: Callable[[Progress], None],
) -> list[RunSpec]:
    """Runs searches to their ends, in rounds of one run each; returns the runs that they took."""
    taken: dict[str, RunSpec] = {}
    results: dict[str, Row] = {}

    def result_of(spec: RunSpec) -> Row | None:
        taken.setdefault(spec.run_id, spec)
        if spec.run_id not in results:
            part = store.stored(spec) if spec.run_id in ran else store.read(spec)
            if part is None:
                return None
            results[spec.run_id] = part.run
        return results[spec.run_id]

    ran: set[str] = set()
    open_searches = list(searches)
    while open_searches:
        asked = [(search, search.next_run(result_of)) for search in open_searches]
        open_searches = [search for search, spec in asked if spec is not None]
        round_of = {spec.run_id: spec for _, spec in asked if spec is not None}
        if round_of:
            run_missing(store, list(round_of.values()), jobs, report)
            ran |= round_of.keys()
    return sorted(taken.values(), key=sort_key)


def _results(specs: Sequence[AnySpec], jobs: int) -> Results:
    """Yields runs as they are done.

    Where a worker dies, what it had not done is run again; what is left after some deaths runs
    in workers of its own, so that a run which kills its worker fails alone.
    """
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    left = {spec.run_id: spec for spec in specs}
    for _ in range(DEATHS_BEFORE_ISOLATION):
        if not left:
            return
        try:
            for part in _in_workers(list(left.values()), jobs):
                yield left.pop(part.run["run_id"]), part
        except TerminatedWorkerError:
            continue
    for spec in left.values():
        try:
            (part,) = _in_workers([spec], max(2, jobs) if jobs != ALL_WORKERS else jobs)
        except TerminatedWorkerError:
            died = f"strategy {spec.keys['strategy']}: the process that ran it died"
            part = _failed(spec, died, 0.0)
        yield spec, part


def _in_workers(specs: Sequence[AnySpec], jobs: int) -> Iterator[Part]:
    import joblib as untyped_joblib

    joblib: Any = untyped_joblib
    parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
    yield from parallel(joblib.delayed(execute_part)(spec) for spec in specs)


def usable_cores() -> int:
    """Returns how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
