"""Runs what a study still lacks, on all cores, and keeps every result as it comes."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import joblib as untyped_joblib
from joblib.externals.loky.process_executor import TerminatedWorkerError

from coramp.errors import CorampError
from coramp.running import RunSpec, execute, failed_row
from coramp.studies.store import Part, Store

joblib: Any = untyped_joblib

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


def execute_part(spec: RunSpec) -> Part:
    """Returns the part of one run, a failed one too: what goes wrong stays in its own row."""
    started = time.perf_counter()
    try:
        tables, row = execute(spec)
    except CorampError as error:
        return Part(failed_row(spec, "; ".join(error.messages), time.perf_counter() - started), [])
    except Exception as error:  # noqa: BLE001 - a bug in one run must not take the study down
        text = f"{type(error).__name__}: {error}"
        return Part(failed_row(spec, text, time.perf_counter() - started), [])
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
    store: Store, specs: Sequence[RunSpec], jobs: int, report: Callable[[Progress], None]
) -> list[Part]:
    """Returns the parts of all runs, in their order, running those that the store lacks.

    ``report`` is called at the start and after every run.
    """
    parts = {spec.run_id: store.read(spec) for spec in specs}
    missing = [spec for spec in specs if parts[spec.run_id] is None]
    damaged = sum(store.is_damaged(spec) for spec in missing)
    skipped = len(specs) - len(missing)
    failed = 0
    report(Progress(len(specs), 0, skipped, 0, damaged))
    for done, (spec, part) in enumerate(_results(missing, jobs), 1):
        store.write(spec, part)
        parts[spec.run_id] = part
        failed += part.run["status"] == "failed"
        report(Progress(len(specs), done, skipped, failed, damaged, part))
    return [part for part in (parts[spec.run_id] for spec in specs) if part is not None]


def _results(specs: Sequence[RunSpec], jobs: int) -> Iterator[tuple[RunSpec, Part]]:
    """Yields runs as they are done.

    Where a worker dies, what it had not done is run again; what is left after some deaths runs
    in workers of its own, so that a run which kills its worker fails alone.
    """
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
            (part,) = _in_workers([spec], max(2, jobs))
        except TerminatedWorkerError:
            part = Part(failed_row(spec, "the process that ran it died", 0.0), [])
        yield spec, part


def _in_workers(specs: Sequence[RunSpec], jobs: int) -> Iterator[Part]:
    parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
    yield from parallel(joblib.delayed(execute_part)(spec) for spec in specs)


def usable_cores() -> int:
    """Returns how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
