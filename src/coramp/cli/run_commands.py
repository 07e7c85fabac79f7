"""Commands that compute: plan, run, study, audit."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from coramp.cli.completion import snapshot_names, study_names
from coramp.cli.options import UNSAFE, WRONG, Json, Kmh, ScenarioName, StrategyName, Wide
from coramp.errors import CorampError

computing = typer.Typer(rich_markup_mode=None)


@computing.command(epilog="Example: coramp plan example --plot example.png")
def plan(
    snapshot: Annotated[
        str,
        typer.Argument(help="A built-in snapshot or a TOML file.", autocompletion=snapshot_names),
    ],
    strategy: StrategyName = "mainline-priority",
    json: Json = False,
    wide: Wide = False,
    plot: Annotated[
        Path | None, typer.Option(help="Write a time-space diagram (png, svg or pdf).")
    ] = None,
) -> None:
    """Plan a snapshot; show each quantity with its equation."""
    from coramp.api import plan as plan_snapshot
    from coramp.cli.console import plan_json, print_json, print_plan, tell_of_compiling

    tell_of_compiling()
    result = plan_snapshot(snapshot, strategy)
    if plot is not None:
        from coramp.report.plan_figure import save_plan_figure

        save_plan_figure(result.planned, plot)
    if json:
        print_json(plan_json(result))
    else:
        print_plan(result, wide)


@computing.command(
    epilog="Example: coramp run paper -s ramp-priority --mainline 1800 --ramp 500 --out out/r\n\n"
    "Example: coramp run corridor.toml -s mixed-slots --processes 2 --out out/c"
)
def run(
    scenario: ScenarioName,
    strategy: StrategyName = "mainline-priority",
    engine: Annotated[str, typer.Option(help="Engine: sumo or exact.")] = "sumo",
    mainline: Annotated[float | None, typer.Option(help="Mainline flow in veh/h.")] = None,
    ramp: Annotated[float | None, typer.Option(help="Ramp flow in veh/h.")] = None,
    drivers: Annotated[
        str | None,
        typer.Option(
            help="Drivers: paper, fair or others of the scenario, or a file of coramp calibrate."
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the scenario."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of arrivals, speeds and SUMO.")] = 1,
    horizon: Annotated[float | None, typer.Option(help="Seconds of arrivals.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the records.")] = None,
    keep_sumo: Annotated[bool, typer.Option(help="Keep SUMO's own files in OUT/sumo.")] = False,
    keep_messages: Annotated[
        bool,
        typer.Option(
            help="Keep messages and commands, for coramp audit; among drivers for explain."
        ),
    ] = False,
    gui: Annotated[bool, typer.Option(help="Watch in sumo-gui.")] = False,
    processes: Annotated[
        int | None,
        typer.Option(help="Processes of a corridor's coordinators (default: this one alone)."),
    ] = None,
    json: Json = False,
    wide: Wide = False,
    kmh: Kmh = False,
) -> None:
    """Run a scenario once: a merge site, or a corridor of several."""
    from coramp.scenarios.corridors import is_corridor

    if is_corridor(scenario):
        from coramp.cli.corridor_console import run_corridor_command

        given = {
            "--mainline": mainline,
            "--ramp": ramp,
            "--keep-messages": keep_messages or None,
            "--engine": None if engine == "sumo" else engine,
        }
        found = run_corridor_command(
            scenario,
            strategy,
            refused=[option for option, value in given.items() if value is not None],
            drivers=drivers,
            settings=settings or [],
            seed=seed,
            horizon_s=horizon,
            processes=processes,
            out=out,
            keep_sumo=keep_sumo,
            gui=gui,
            json=json,
            wide=wide,
        )
        _exit_if_broken(found.broken_promises)
        return
    if processes is not None:
        raise CorampError(
            f"--processes: {scenario} has one merge site; allowed is a scenario with [corridor]"
        )
    from coramp.api import run as run_scenario
    from coramp.cli.console import (
        print_json,
        print_run,
        tell_of_compiling,
        tell_of_demand,
        working,
    )
    from coramp.scenarios.toml_files import parse_overrides
    from coramp.studies.speed_unit import KMH, MPS

    if keep_messages and out is None:
        raise CorampError("--keep-messages: there is no folder to keep them in; give --out DIR")
    tell_of_compiling()
    with working("running"):
        result = run_scenario(
            scenario,
            strategy,
            engine=engine,
            mainline_veh_h=mainline,
            ramp_veh_h=ramp,
            drivers=drivers,
            overrides=parse_overrides(settings or []),
            seed=seed,
            horizon_s=horizon,
            out=out,
            keep_sumo=keep_sumo,
            keep_messages=keep_messages,
            gui=gui,
            notice=tell_of_demand,
        )
    if json:
        print_json(result.content)
    else:
        print_run(result, out, wide, KMH if kmh else MPS)
    _exit_if_broken(result.broken_promises)


@computing.command(
    epilog="Example: coramp study paper --seeds 10 --out out/p10\n\n"
    "Example: coramp study paper --wide"
)
def study(
    name: Annotated[
        str, typer.Argument(help="A built-in study or a TOML file.", autocompletion=study_names)
    ],
    seeds: Annotated[int | None, typer.Option(help="Seeds 1 to N (default: the study's).")] = None,
    jobs: Annotated[int | None, typer.Option(help="Processes (default: all cores).")] = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A Dask scheduler, such as tcp://host:8786."),
    ] = None,
    engine: Annotated[
        str | None, typer.Option(help="Engine of cooperative runs: sumo or exact.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder (default: out/NAME).")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only print what would run, and for how long.")
    ] = False,
    status: Annotated[bool, typer.Option("--status", help="Only print what is done.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Allow more than 100,000 runs.")] = False,
    json: Json = False,
    wide: Wide = False,
    kmh: Kmh = False,
) -> None:
    """Run a grid of runs; resume where an earlier start stopped."""
    from coramp.api import outlook
    from coramp.api import study as run_study
    from coramp.cli.console import (
        counted,
        outlook_json,
        print_json,
        print_outlook,
        print_study,
        study_json,
        tell_of_compiling,
        tell_of_demand,
    )
    from coramp.cli.study_progress import StudyProgress

    if dry_run or status:
        ahead = outlook(name, seeds=seeds, jobs=jobs, engine=engine, out=out, many=yes)
        if json:
            print_json(outlook_json(ahead))
        else:
            print_outlook(ahead, wide)
        return
    tell_of_compiling()
    with StudyProgress() as progress:
        result = run_study(
            name,
            seeds=seeds,
            jobs=jobs,
            cluster=cluster,
            engine=engine,
            out=out,
            many=yes,
            progress=progress,
            notice=tell_of_demand,
            kmh=kmh,
        )
    if json:
        print_json(study_json(result))
    else:
        print_study(result, wide)
    failed = result.failed.height
    if failed:
        print(
            f"Error: {counted(failed, 'run')} failed; see the error column of "
            f"{result.folder / 'runs.parquet'}, and start again to run what failed",
            file=sys.stderr,
        )
    _exit_if_broken(result.broken_promises)
    if failed:
        raise typer.Exit(WRONG)


@computing.command(epilog="Example: coramp audit out/r")
def audit(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A folder of coramp run --out --keep-messages.")
    ],
    json: Json = False,
    wide: Wide = False,
) -> None:
    """Check a run's decisions and safety from its messages."""
    from coramp.audit.audit import as_data
    from coramp.audit.audit import audit as audited
    from coramp.cli.console import print_audit, print_json, tell_of_compiling

    tell_of_compiling()
    result = audited(folder)
    if json:
        print_json(as_data(result))
    else:
        print_audit(result, wide)
    for found in result.contradictions:
        print(f"Contradiction: {found.line}", file=sys.stderr)
    if not result.holds:
        raise typer.Exit(UNSAFE)


def _exit_if_broken(broken: list[str]) -> None:
    if broken:
        for line in broken:
            print(f"Unsafe: {line}", file=sys.stderr)
        raise typer.Exit(UNSAFE)
