"""The single runs behind speeds and margins: run once, then read from their folders."""

from collections.abc import Callable, Sequence
from pathlib import Path

from coramp.records.files import made_folder
from coramp.records.run import RunRecords
from coramp.records.run_folder import (
    MARK,
    not_replaceable,
    read_run,
    write_run,
)
from coramp.records.staging import staged_folder
from coramp.runs.running import RunSpec, make_spec, recorded
from coramp.studies.runner import Progress
from coramp.studies.store import Part

MAINLINE_VEH_H = 1800.0
RAMPS_VEH_H = (200.0, 300.0, 500.0)
"""The flows of Fig. 14 and 15."""
SCENARIO = "paper"


def specs_of(seeds: int, horizon_s: float | None) -> list[RunSpec]:
    """Returns the runs that are drawn, at each ramp flow.

    They are the paper's drivers in SUMO with the first seed, and both cooperative strategies in
    the exact engine with every seed.
    """
    return [
        make_spec(
            SCENARIO,
            strategy,
            engine="sumo" if drivers else "exact",
            drivers=drivers,
            mainline_veh_h=MAINLINE_VEH_H,
            ramp_veh_h=ramp,
            seed=seed,
            horizon_s=horizon_s,
        )
        for ramp in RAMPS_VEH_H
        for strategy, drivers, last_seed in (
            ("uncontrolled", "paper", 1),
            ("mainline-priority", None, seeds),
            ("ramp-priority", None, seeds),
        )
        for seed in range(1, last_seed + 1)
    ]


def drawn_runs(
    folder: Path, specs: Sequence[RunSpec], report: Callable[[Progress], None]
) -> list[RunRecords]:
    """Returns the runs, from a folder each below ``folder``; those that are missing are run.

    ``report`` is called at the start and after every run. Raises CorampError for a run that fails
    and for a folder that cannot be written or read.
    """
    made_folder(folder)
    missing = [spec for spec in specs if not (folder / spec.run_id / MARK).exists()]
    skipped = len(specs) - len(missing)
    report(Progress(len(specs), 0, skipped, 0, 0))
    for done, spec in enumerate(missing, 1):
        with staged_folder(folder / spec.run_id, not_replaceable) as stage:
            records = recorded(spec)
            write_run(stage, records)
        report(Progress(len(specs), done, skipped, 0, 0, Part(records.summary, [])))
    return [read_run(folder / spec.run_id) for spec in specs]
