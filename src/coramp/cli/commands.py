"""The command line: parses, calls one function, prints."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from coramp.cli.completion import scenario_names, snapshot_names, strategy_names, study_names
from coramp.errors import CorampError, printable

WRONG, USAGE, UNSAFE, STOPPED = 1, 2, 3, 130
DEBUG = "--debug"

app = typer.Typer(
    name="coramp",
    help="Cooperative on-ramp merging: plan, simulate, compare and explain.",
    epilog="Example: coramp run paper --mainline 1500 --ramp 700 --seed 77 --out out/r",
    rich_markup_mode=None,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
StrategyName = Annotated[
    str,
    typer.Option(
        "--strategy", "-s", help="See `coramp strategies`.", autocompletion=strategy_names
    ),
]
ScenarioName = Annotated[
    str,
    typer.Argument(help="A built-in scenario or a TOML file.", autocompletion=scenario_names),
]


def _told_version(asked: bool) -> None:
    if asked:
        from importlib import metadata

        print(f"coramp {metadata.version('coramp')}")
        raise typer.Exit


@app.callback()
def _options(
    _debug: Annotated[bool, typer.Option(DEBUG, help="Show tracebacks of errors.")] = False,
    _version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_told_version, help="Say the version."),
    ] = False,
) -> None:
    """Cooperative on-ramp merging: plan, simulate, compare and explain."""


@app.command(
    epilog="Examples: coramp scenarios paper > my-ramp.toml; coramp scenarios my-ramp.toml"
)
def scenarios(
    name: Annotated[
        str | None,
        typer.Argument(
            help="Print this built-in one's TOML, to start your own from, or a file of yours with "
            "all that is chosen for it."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """List the built-in scenarios, snapshots and studies, or print one of them or of yours."""
    from coramp.cli.console import print_json, print_listing
    from coramp.cli.listing import listing, printed

    if name is not None:
        print(printed(name), end="")
        return
    found = listing()
    if json:
        print_json(found)
    else:
        print_listing(found)


@app.command(epilog="Example: coramp strategies")
def strategies(json: Json = False) -> None:
    """List the strategies, with the package of those that are not coramp's own."""
    from coramp.cli.console import print_json, print_listing
    from coramp.strategies.registry import OURS, broken_plugins, origin_of
    from coramp.strategies.registry import strategies as registered

    origins = {name: origin_of(name) for name in registered()}
    texts = {
        name: s.summary if origins[name] == OURS else printable(f"{s.summary} [{origins[name]}]")
        for name, s in registered().items()
    }
    found = {"strategies": texts}
    for problem in broken_plugins():
        print(f"Left out: {problem}", file=sys.stderr)
    if json:
        print_json(found)
    else:
        print_listing(found)


@app.command("new-strategy", epilog="Example: coramp new-strategy mine && pip install ./mine")
def new_strategy(
    name: Annotated[str, typer.Argument(help="The strategy's name, such as mine.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write (default: ./NAME).")] = None,
) -> None:
    """Write a package with a strategy of your own, working, and its contract test."""
    from coramp.cli.skeleton import write_skeleton

    folder = write_skeleton(name, out or Path(name))
    place = folder if folder.is_absolute() else f"./{folder}"
    print(f"Written: {folder}; now pip install {place}, and coramp run paper --strategy {name}")


@app.command(epilog="Example: coramp plan example --plot example.png")
def plan(
    snapshot: Annotated[
        str,
        typer.Argument(help="A built-in snapshot or a TOML file.", autocompletion=snapshot_names),
    ],
    strategy: StrategyName = "mainline-priority",
    json: Json = False,
    plot: Annotated[
        Path | None, typer.Option(help="Write a time-space diagram (png, svg or pdf).")
    ] = None,
) -> None:
    """Plan one given situation and show every quantity with its equation."""
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
        print_plan(result)


@app.command(
    epilog="Example: coramp run paper -s ramp-priority --mainline 1800 --ramp 500 --out out/r"
)
def run(
    scenario: ScenarioName,
    strategy: StrategyName = "mainline-priority",
    engine: Annotated[str, typer.Option(help="What moves the vehicles: sumo or exact.")] = "sumo",
    mainline: Annotated[float | None, typer.Option(help="Mainline flow in veh/h.")] = None,
    ramp: Annotated[float | None, typer.Option(help="Ramp flow in veh/h.")] = None,
    drivers: Annotated[
        str | None,
        typer.Option(
            help="Who drives uncontrolled vehicles: paper, fair or another of the scenario."
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
        bool, typer.Option(help="Keep what was told and commanded, for coramp audit.")
    ] = False,
    gui: Annotated[bool, typer.Option(help="Watch in sumo-gui.")] = False,
    json: Json = False,
) -> None:
    """Run one scenario."""
    from coramp.api import run as run_scenario
    from coramp.cli.console import (
        print_json,
        print_run,
        tell_of_compiling,
        tell_of_demand,
        working,
    )
    from coramp.scenarios.toml_files import parse_overrides

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
        print_run(result, out)
    _exit_if_broken(result.broken_promises)


@app.command(epilog="Example: coramp study paper --seeds 10 --out out/p10")
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
        str | None, typer.Option(help="What moves cooperative vehicles: sumo or exact.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder (default: out/NAME).")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say what would run, and for how long.")
    ] = False,
    status: Annotated[bool, typer.Option("--status", help="Only say what is done.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Run even very many runs.")] = False,
    json: Json = False,
) -> None:
    """Run a grid of runs; go on where an earlier start left off."""
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
            print_outlook(ahead)
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
        )
    if json:
        print_json(study_json(result))
    else:
        print_study(result)
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


@app.command(epilog="Example: coramp audit out/r")
def audit(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A folder of coramp run --out --keep-messages.")
    ],
    json: Json = False,
) -> None:
    """Check a run by its messages: every decision, command, report and safety figure."""
    from coramp.audit.audit import as_data
    from coramp.audit.audit import audit as audited
    from coramp.cli.console import print_audit, print_json, tell_of_compiling

    tell_of_compiling()
    result = audited(folder)
    if json:
        print_json(as_data(result))
    else:
        print_audit(result)
    for found in result.contradictions:
        print(f"Contradiction: {found.line}", file=sys.stderr)
    if not result.holds:
        raise typer.Exit(UNSAFE)


@app.command(epilog="Example: coramp explain out/r r00012")
def explain(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of coramp run --out.")],
    vehicle: Annotated[str, typer.Argument(help="A vehicle's id, such as r00012.")],
    json: Json = False,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw the decision: road and time-space diagram (png, svg or pdf)."),
    ] = None,
) -> None:
    """Tell one vehicle's story: why it got its plan, with the equations' numbers."""
    from coramp.cli.console import print_json, print_story, story_json
    from coramp.explain.story import story_in
    from coramp.records.run_folder import read_run

    run = read_run(folder)
    story = story_in(run, vehicle, folder)
    if plot is not None:
        from coramp.report.story_figure import save_story_figure

        save_story_figure(run, vehicle, plot)
    if json:
        print_json(story_json(story))
    else:
        print_story(story)


@app.command(epilog="Example: coramp report out/r --against out/u")
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of a run or a study.")],
    against: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Another run on the same arrivals, to stand beside it."),
    ] = None,
) -> None:
    """Write DIR/report.html: one file to hand on, which works without a network."""
    from coramp.cli.console import written
    from coramp.report.writing import report as write_report

    written(write_report(folder, against))


@app.command(epilog="Example: coramp replay out/r --against out/u")
def replay(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of coramp run --out.")],
    against: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Another run on the same arrivals, to be seen beside it."),
    ] = None,
) -> None:
    """Write DIR/replay.html: the merge from above, to play in a browser."""
    from coramp.cli.console import written
    from coramp.report.writing import replay as write_replay

    written(write_replay(folder, against))


@app.command(epilog="Example: coramp studio my-ramp.toml --port 8650 --open")
def studio(
    scenario: ScenarioName = "paper",
    port: Annotated[int, typer.Option(help="Port on this machine; 0 takes any.")] = 8642,
    show: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
) -> None:
    """Play with a scenario: a local page with sliders whose picture follows at once."""
    from coramp.cli.console import serving, tell_of_compiling
    from coramp.studio.server import serve

    tell_of_compiling()
    serve(scenario, port, lambda address: serving(address, show))


@app.command(epilog="Example: coramp figures --seeds 10 --study out/capacity --out out/figures")
def figures(
    out: Annotated[
        Path, typer.Option(help="Folder for the figures; runs are kept in its study/.")
    ] = Path("out/figures"),
    seeds: Annotated[int, typer.Option(help="Seeds 1 to N of what is run for them.")] = 3,
    jobs: Annotated[int | None, typer.Option(help="Processes (default: all cores).")] = None,
    studies: Annotated[
        list[Path] | None,
        typer.Option(
            "--study",
            metavar="FOLDER",
            help="Draw this finished study too (capacity), or in place of a run of "
            "its own (paper, sensitivity).",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Draw the paper's figures and ours, as SVG and PNG; run what they need."""
    from coramp.api import figures as draw_figures
    from coramp.cli.console import (
        figures_json,
        print_figures,
        print_json,
        tell_of_compiling,
    )
    from coramp.cli.study_progress import StudyProgress

    tell_of_compiling()
    with StudyProgress() as progress:
        result = draw_figures(out, seeds=seeds, jobs=jobs, studies=studies or (), progress=progress)
    if json:
        print_json(figures_json(result))
    else:
        print_figures(result)


def _exit_if_broken(broken: list[str]) -> None:
    if broken:
        for line in broken:
            print(f"Unsafe: {line}", file=sys.stderr)
        raise typer.Exit(UNSAFE)
