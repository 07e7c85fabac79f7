"""Commands that tell and show what was computed: explain, report, compare, export, and others."""

from pathlib import Path
from typing import Annotated

import typer

from coramp.cli.options import Json, Kmh, ScenarioName, Wide
from coramp.errors import CorampError

showing = typer.Typer(rich_markup_mode=None)


@showing.command(epilog="Example: coramp explain out/r r00012")
def explain(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of coramp run --out.")],
    vehicle: Annotated[str, typer.Argument(help="A vehicle's id, such as r00012.")],
    json: Json = False,
    wide: Wide = False,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw the decision: road and time-space diagram (png, svg or pdf)."),
    ] = None,
) -> None:
    """Explain one vehicle's plan, with the numbers behind it."""
    from coramp.cli.console import print_json, print_story, story_json
    from coramp.cli.mixed_console import mixed_story_json, print_mixed_story
    from coramp.explain.mixed_story import is_told_apart, mixed_story_in
    from coramp.explain.story import story_in
    from coramp.records.run_folder import read_run

    run = read_run(folder)
    if is_told_apart(run):
        if plot is not None:
            raise CorampError(
                "--plot: it draws a plan, and vehicles among drivers drive without plans; leave "
                "it out to read what the vehicle did"
            )
        mixed = mixed_story_in(run, vehicle, folder)
        if json:
            print_json(mixed_story_json(mixed))
        else:
            print_mixed_story(mixed)
        return
    story = story_in(run, vehicle, folder)
    if plot is not None:
        from coramp.report.story_figure import save_story_figure

        save_story_figure(run, vehicle, plot)
    if json:
        print_json(story_json(story))
    else:
        print_story(story, wide)


@showing.command(epilog="Example: coramp report out/r --against out/u --kmh")
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of a run or a study.")],
    against: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Another run on the same arrivals, shown beside it."),
    ] = None,
    kmh: Kmh = False,
) -> None:
    """Write DIR/report.html, one file that needs no network."""
    from coramp.cli.console import written
    from coramp.report.writing import report as write_report

    written(write_report(folder, against, kmh=kmh))


@showing.command(epilog="Example: coramp compare out/before out/after --out compared.html")
def compare(
    before: Annotated[
        Path, typer.Argument(metavar="BEFORE", help="A folder of a run, or of runs, one a seed.")
    ],
    after: Annotated[Path, typer.Argument(metavar="AFTER", help="The same, on the same arrivals.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the two-page summary (html).")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw speeds and queues of the first seed (png, svg or pdf)."),
    ] = None,
    json: Json = False,
    wide: Wide = False,
    kmh: Kmh = False,
) -> None:
    """Compare runs before and after, with intervals over seeds."""
    from coramp.agency.before_after import changes_json, paired
    from coramp.cli.console import print_json, print_table, written
    from coramp.report.contour_figure import both_figure
    from coramp.report.page.summary import before_after_table, names_of
    from coramp.report.style import save_plot
    from coramp.report.writing import compared
    from coramp.studies.speed_unit import KMH, MPS

    pairs = paired(before, after)
    page = None if out is None else compared(out, pairs, kmh=kmh)
    if plot is not None:
        runs, unit = pairs[0], KMH if kmh else MPS
        save_plot(lambda: both_figure(runs, names_of(runs), unit), plot)
    if json:
        print_json(changes_json(pairs))
        return
    print_table(before_after_table(pairs), wide)
    if page is not None:
        written(page)


@showing.command(epilog="Example: coramp export out/r out/tables")
def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of a run or a study.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A new folder for the tables.")],
) -> None:
    """Write every table as CSV, and loops in SUMO's formats."""
    from coramp.agency.export import export as exported
    from coramp.cli.console import counted

    files = exported(folder, out)
    print(f"Written: {counted(len(files), 'file')} to {out}: {', '.join(f.name for f in files)}.")


@showing.command(epilog="Example: coramp replay out/r --against out/u")
def replay(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder of coramp run --out.")],
    against: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Another run on the same arrivals, shown beside it."),
    ] = None,
) -> None:
    """Write DIR/replay.html: the merge from above, as a film."""
    from coramp.cli.console import written
    from coramp.report.writing import replay as write_replay

    written(write_replay(folder, against))


@showing.command(epilog="Example: coramp studio my-ramp.toml --port 8650 --open")
def studio(
    scenario: ScenarioName = "paper",
    port: Annotated[int, typer.Option(help="Port on this machine; 0 takes any.")] = 8642,
    show: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
) -> None:
    """Explore a scenario on a local page with sliders."""
    from coramp.cli.console import serving, tell_of_compiling
    from coramp.studio.server import serve

    tell_of_compiling()
    serve(scenario, port, lambda address: serving(address, show))


@showing.command(epilog="Example: coramp figures --seeds 10 --study out/capacity --out out/figures")
def figures(
    out: Annotated[
        Path, typer.Option(help="Folder for the figures; runs are kept in its study/.")
    ] = Path("out/figures"),
    seeds: Annotated[int, typer.Option(help="Seeds 1 to N of the runs behind them.")] = 3,
    jobs: Annotated[int | None, typer.Option(help="Processes (default: all cores).")] = None,
    studies: Annotated[
        list[Path] | None,
        typer.Option(
            "--study",
            metavar="FOLDER",
            help="A finished study: capacity is drawn too, paper or sensitivity is drawn "
            "instead of being run again.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Draw the paper's figures and ours, as SVG and PNG."""
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
