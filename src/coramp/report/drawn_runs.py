"""The single runs behind speeds and margins: run once, then read from their folders."""

from collections.abc import Callable, Sequence
from pathlib import Path

from coramp.files import made_folder
from coramp.report.run_figures import DrawnRun
from coramp.run_folder import MARK, StoredRun, not_replaceable, read_run, write_run
from coramp.running import RunSpec, execute, make_spec
from coramp.staging import staged_folder
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
) -> list[DrawnRun]:
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
            tables, row = execute(spec)
            frames = tables.frames()
            write_run(stage, spec, frames, row)
        report(Progress(len(specs), done, skipped, 0, 0, Part(row, [])))
    return [_drawn(spec, read_run(folder / spec.run_id)) for spec in specs]


def _drawn(spec: RunSpec, stored: StoredRun) -> DrawnRun:
    scenario = spec.scenario
    return DrawnRun(
        spec.strategy,
        spec.drivers,
        scenario.mainline.flow_veh_h,
        scenario.ramp.flow_veh_h,
        spec.seed,
        scenario.simulation.horizon_s,
        stored.speeds,
        stored.decisions,
    )
