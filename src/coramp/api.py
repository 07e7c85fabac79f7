"""What notebooks and the command line call: run, study, load, plan, figures, register."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coramp.errors import CorampError
from coramp.records.corridor_run import holds_corridor, read_corridor
from coramp.records.files import made_folder
from coramp.records.run import RunRecords
from coramp.records.run_folder import MARK as RUN_MARK
from coramp.records.run_folder import SUMO, not_replaceable, read_run, write_run
from coramp.records.staging import staged_folder
from coramp.results import CorridorStudyResult, PlanResult, RunResult, StudyResult, as_pandas
from coramp.runs.beforehand import (
    demand_above_limit,
    demands_above_limit,
    faults_that_reach_nobody,
    seeds_without_effect,
    without_effect_on_drivers,
)
from coramp.runs.corridors import (
    CorridorResult,
    CorridorSpec,
    corridor_spec,
    execute_corridor,
    processes_checked,
    unserved_notice,
    write_corridor,
)
from coramp.runs.metering import room_lines
from coramp.runs.planning import plan_snapshot
from coramp.runs.running import RunSpec, engine_checked, make_spec, recorded, stored_spec
from coramp.scenarios.corridors import load_corridor
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.snapshots import load_snapshot
from coramp.strategies import registry
from coramp.studies.breakdown import bisections
from coramp.studies.cluster import connected
from coramp.studies.corridor_grid import count_corridor_runs, expand_corridor, is_of_corridor
from coramp.studies.corridor_summary import corridor_study_tables
from coramp.studies.definition import Study, count_runs, expand, load_study, sort_key
from coramp.studies.outlook import Outlook, outlook_of
from coramp.studies.runner import ALL_WORKERS, Progress, run_missing, run_searches, usable_cores
from coramp.studies.shown import keep_shown
from coramp.studies.speed_unit import KMH, MPS
from coramp.studies.store import MARK as STUDY_MARK
from coramp.studies.store import OF_CORRIDOR, Store
from coramp.studies.summary import summary_tables, to_markdown
from coramp.worlds.sumo.files import SumoOptions

if TYPE_CHECKING:
    from coramp.report.figures import FigureSet


__all__ = [
    "CorridorResult",
    "CorridorStudyResult",
    "PlanResult",
    "RunResult",
    "StudyResult",
    "as_pandas",
    "corridor",
    "figures",
    "load",
    "outlook",
    "plan",
    "register",
    "run",
    "study",
]

register = registry.register
MANY_RUNS = 100_000
"""More runs than this are asked about first."""
CHANGED = "the scenario file was changed since: runs that the change concerns are run again"


def run(
    scenario: str,
    strategy: str = "mainline-priority",
    *,
    engine: str = "sumo",
    mainline_veh_h: float | None = None,
    ramp_veh_h: float | None = None,
    drivers: str | None = None,
    overrides: Mapping[str, Any] | None = None,
    seed: int = 1,
    horizon_s: float | None = None,
    out: str | Path | None = None,
    keep_sumo: bool = False,
    gui: bool = False,
    keep_messages: bool = False,
    notice: Callable[[str], None] | None = None,
) -> RunResult:
    """Runs a scenario once and returns its records; writes them to ``out`` if that is given.

    ``overrides`` are dotted keys of the scenario. ``drivers`` is the population of an uncontrolled
    run (default: fair). ``keep_messages`` keeps what the coordinator was told and commanded, for
    ``coramp audit``; among drivers it keeps what vehicles did, for ``coramp explain``. ``notice``
    is told beforehand where demand is above the lane's limit, and afterwards who is unserved.
    Raises CorampError for what cannot be run and for a run that fails.

    Examples:
        >>> coramp.run("paper", mainline_veh_h=1500, ramp_veh_h=700, seed=77)  # doctest: +SKIP
    """
    spec = make_spec(
        scenario,
        strategy,
        engine=engine,
        mainline_veh_h=mainline_veh_h,
        ramp_veh_h=ramp_veh_h,
        drivers=drivers,
        overrides=overrides,
        seed=seed,
        horizon_s=horizon_s,
    )
    if engine != "sumo" and (keep_sumo or gui):
        option = "--keep-sumo" if keep_sumo else "--gui"
        raise CorampError(f"{option}: the {engine} engine runs without SUMO; use --engine sumo")
    if out is None and keep_sumo:
        raise CorampError("--keep-sumo: there is no folder to keep files in; give --out DIR")
    if notice is not None and (line := demand_above_limit(spec)) is not None:
        notice(line)
    if notice is not None and (line := without_effect_on_drivers([spec])) is not None:
        notice(line)
    if notice is not None and (line := faults_that_reach_nobody([spec])) is not None:
        notice(line)
    if notice is not None and seed != 1 and not spec.seed_matters:
        notice(f"arrivals are listed: with {strategy} seed {seed} changes nothing")
    if out is None:
        return _executed(spec, SumoOptions(gui=gui, keep_messages=keep_messages), notice)
    with staged_folder(Path(out), not_replaceable) as stage:
        options = SumoOptions(stage / SUMO if keep_sumo else None, gui, keep_messages)
        result = _executed(spec, options, notice)
        write_run(stage, result)
    return result


def corridor(
    scenario: str,
    strategy: str = "mixed-slots",
    *,
    drivers: str | None = None,
    overrides: Mapping[str, Any] | None = None,
    seed: int = 1,
    processes: int = 1,
    out: str | Path | None = None,
    keep_sumo: bool = False,
    gui: bool = False,
    notice: Callable[[str], None] | None = None,
) -> CorridorResult:
    """Runs a corridor once, each site with a coordinator of its own; writes to ``out`` if given.

    ``scenario`` is a file with ``[corridor]``. Coordinators run in this process, or in so many
    ``processes`` of their own; the figures are the same. ``notice`` is told who is unserved,
    and what room metered ramps have. Raises CorampError for what cannot be run and for a run that
    fails.
    """
    processes_checked(processes)
    spec = corridor_spec(scenario, strategy, drivers=drivers, overrides=overrides, seed=seed)
    if out is None and keep_sumo:
        raise CorampError("--keep-sumo: there is no folder to keep files in; give --out DIR")
    if notice is not None:
        for line in room_lines(spec.corridor, strategy, spec.drivers):
            notice(line)
    if out is None:
        result = execute_corridor(spec, processes, SumoOptions(gui=gui))
    else:
        with staged_folder(Path(out), not_replaceable) as stage:
            options = SumoOptions(stage / SUMO if keep_sumo else None, gui)
            result = execute_corridor(spec, processes, options)
            write_corridor(stage, result)
    if notice is not None:
        unserved_notice(result, notice)
    return result


def _executed(
    spec: RunSpec, options: SumoOptions, notice: Callable[[str], None] | None
) -> RunResult:
    return _with_spec(recorded(spec, options, notice or (lambda _: None)), spec)


def _with_spec(records: RunRecords, spec: RunSpec) -> RunResult:
    return RunResult(**{f.name: getattr(records, f.name) for f in fields(records)}, spec=spec)


def study(
    name: str,
    *,
    seeds: int | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    engine: str | None = None,
    out: str | Path | None = None,
    many: bool = False,
    progress: Callable[[Progress], None] | None = None,
    notice: Callable[[str], None] | None = None,
    kmh: bool = False,
) -> StudyResult:
    """Runs what a study still lacks and returns all of it.

    ``name`` is a built-in study or a TOML file; ``out`` is where it is kept (default:
    ``out/NAME``), and a study that was interrupted goes on from there. ``jobs`` processes work at
    a time (default: one a core), or the workers of a Dask ``cluster``. ``engine`` moves the
    cooperative runs to another engine. ``many`` allows more than a hundred thousand runs.
    ``progress`` is called at the start and after every run, ``notice`` beforehand where the
    demand of runs is above their lane's limit, and before the runs that the report shows are made
    once more, to keep their records. With ``kmh`` speeds of the tables are in km/h, else in m/s;
    columns of ``runs`` are always in m/s. Raises CorampError for a study that cannot be run;
    runs that fail are rows of the result.
    """
    definition, seeds = _defined(name, seeds, engine, many)
    jobs = _jobs_checked(jobs)
    report = progress or (lambda _: None)
    if is_of_corridor(definition):
        runs_to_do = expand_corridor(definition, seeds, name)
        with connected(cluster) if cluster is not None else nullcontext():
            store = Store(_folder_of(definition, out), definition, OF_CORRIDOR)
            if notice is not None and store.scenario_changed:
                notice(CHANGED)
            run_missing(store, runs_to_do, ALL_WORKERS if cluster is not None else jobs, report)
        return _corridor_study(store, definition, runs_to_do)
    specs, searches = expand(definition, seeds, name), bisections(definition, seeds, name)
    if notice is not None and (line := demands_above_limit(specs)) is not None:
        notice(line)
    if notice is not None and (line := without_effect_on_drivers(specs)) is not None:
        notice(line)
    if notice is not None and (line := faults_that_reach_nobody(specs)) is not None:
        notice(line)
    if notice is not None and seeds > 1 and (line := seeds_without_effect(specs)) is not None:
        notice(line)
    with connected(cluster) if cluster is not None else nullcontext():
        store = Store(_folder_of(definition, out), definition)
        if notice is not None and store.scenario_changed:
            notice(CHANGED)
        jobs = ALL_WORKERS if cluster is not None else jobs
        run_missing(store, specs, jobs, report)
        searched = run_searches(store, searches, jobs, report)
    everything = {spec.run_id: spec for spec in (*specs, *searched)}
    ordered: list[RunSpec] = sorted(everything.values(), key=sort_key)
    runs, streams = store.frames(store.parts(ordered))
    scenario = load_scenario(definition.source).model_dump(mode="json")
    tables = summary_tables(definition, runs, KMH if kmh else MPS, scenario)
    keep_shown(store.folder, definition, runs.filter(status="ok"), notice or (lambda _: None))
    store.write_tables(runs, streams, to_markdown(definition, tables))
    if definition.layout == "capacity":
        from coramp.report.capacity_figure import save_capacity_figure

        save_capacity_figure(runs, store.folder / "capacity.png")
    return StudyResult(store.folder, runs, streams, tuple(tables), definition.layout)


def _corridor_study(
    store: Store, definition: Study, specs: Sequence[CorridorSpec]
) -> CorridorStudyResult:
    """What a corridor's study amounts to, once all of it has run; writes its tables."""
    runs, sites = store.frames(store.parts(specs))
    tables = corridor_study_tables(runs, sites, load_corridor(definition.source).as_data())
    store.write_tables(runs, sites, to_markdown(definition, tables))
    return CorridorStudyResult.of(store.folder, runs, sites, tuple(tables))


def outlook(
    name: str,
    *,
    seeds: int | None = None,
    jobs: int | None = None,
    engine: str | None = None,
    out: str | Path | None = None,
    many: bool = False,
) -> Outlook:
    """Returns how much of a study is done and how long the rest should take; runs nothing."""
    definition, seeds = _defined(name, seeds, engine, many)
    folder, jobs = _folder_of(definition, out), _jobs_checked(jobs)
    begun = (folder / STUDY_MARK).exists()
    if is_of_corridor(definition):
        runs_to_do = expand_corridor(definition, seeds, name)
        store = Store(folder, definition, OF_CORRIDOR) if begun else None
        return outlook_of(store, folder, runs_to_do, (), jobs)
    specs = expand(definition, seeds, name)
    searches = bisections(definition, seeds, name)
    store = Store(folder, definition) if begun else None
    return outlook_of(store, folder, specs, searches, jobs)


def _jobs_checked(jobs: int | None) -> int:
    jobs = usable_cores() if jobs is None else jobs
    if jobs < 1:
        raise CorampError(f"--jobs: {jobs} is too small; allowed is at least 1")
    return jobs


def _defined(name: str, seeds: int | None, engine: str | None, many: bool) -> tuple[Study, int]:
    definition = load_study(name)
    if engine is not None:
        definition = definition.on_engine(engine_checked(engine))
    seeds = definition.seeds if seeds is None else seeds
    try:
        count = count_corridor_runs if is_of_corridor(definition) else count_runs
        runs = count(definition, max(1, seeds))
    except CorampError as error:
        raise CorampError(*(f"{name}: {line}" for line in error.messages)) from None
    if runs > MANY_RUNS and not many:
        raise CorampError(
            f"{name}: has {runs} runs; add --yes to run so many, or lower --seeds or the flows"
        )
    return definition, seeds


def _folder_of(definition: Study, out: str | Path | None) -> Path:
    return Path(out) if out is not None else Path("out") / definition.name


def load(folder: str | Path) -> RunResult | StudyResult | CorridorResult:
    """Returns the run or the study that lies in a folder, with its tables and figures.

    Of a study that is not finished, what is done. Raises CorampError where there is neither, or it
    cannot be read.
    """
    place = Path(folder)
    if (place / STUDY_MARK).exists():
        from coramp.report.study_folder import (
            is_corridor_study,
            scenario_of,
            stored_corridor,
            stored_runs,
            stored_streams,
        )

        if is_corridor_study(place):
            _, runs, sites = stored_corridor(place)
            told = tuple(corridor_study_tables(runs, sites, scenario_of(place)))
            return CorridorStudyResult.of(place, runs, sites, told)
        definition, runs = stored_runs(place)
        streams = stored_streams(place, definition)
        tables = tuple(summary_tables(definition, runs, scenario=scenario_of(place)))
        return StudyResult(place, runs, streams, tables, definition.layout)
    if not (place / RUN_MARK).exists():
        raise CorampError(
            f"{place}: holds no run and no study; give a folder that coramp run --out or coramp "
            "study has written"
        )
    if holds_corridor(place):
        found = read_corridor(place)
        return CorridorResult(found.content, found.frames)
    records = read_run(place)
    return _with_spec(records, stored_spec(records.content, records.scenario))


def plan(snapshot: str, strategy: str = "mainline-priority") -> PlanResult:
    """Returns what a strategy decides on a snapshot: a built-in name or a TOML file.

    Examples:
        >>> coramp.plan("example").decisions["rung"].item()
        'reach'
    """
    return PlanResult(plan_snapshot(load_snapshot(snapshot), strategy))


def figures(
    out: str | Path = "out/figures",
    *,
    seeds: int = 3,
    jobs: int | None = None,
    studies: Iterable[str | Path] = (),
    progress: Callable[[Progress], None] | None = None,
) -> "FigureSet":
    """Draws the paper's figures and ours into ``out``, as SVG and PNG, from runs of our own.

    It runs the built-in studies ``paper`` and ``sensitivity`` and some single runs with seeds 1 to
    ``seeds``: drivers in SUMO, the others in the exact engine. They are kept in ``out/study``, and
    what is there is not run again. ``studies`` are folders of finished studies to draw in their
    place; that of a capacity study adds its figure. Raises CorampError for what cannot be run,
    read or written.
    """
    from coramp.report.figures import save_figures
    from coramp.report.study_folder import read_study
    from coramp.studies.drawn_runs import drawn_runs, specs_of

    if seeds < 1:
        raise CorampError(f"--seeds: {seeds} is too small; allowed is at least 1")
    given = [read_study(Path(folder)) for folder in studies]
    found = {stored.layout: stored for stored in given}
    folder = made_folder(Path(out))
    for name in ("paper", "sensitivity"):
        if name not in found:
            kept = folder / "study" / name
            study(name, seeds=seeds, jobs=jobs, engine="exact", out=kept, progress=progress)
            found[name] = read_study(kept)
    specs = specs_of(seeds, found["paper"].horizon_s)
    runs = drawn_runs(folder / "study" / "runs", specs, progress or (lambda _: None))
    return save_figures(folder, found, runs)
