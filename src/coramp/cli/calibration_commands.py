"""The command that fits drivers to what detectors told."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from coramp.cli.options import Json, Kmh, ScenarioName

calibration = typer.Typer(rich_markup_mode=None)


@calibration.command(
    epilog="Example: coramp calibrate my-ramp.toml morning.csv --model idm --out morning.toml"
)
def calibrate(
    scenario: ScenarioName,
    counts: Annotated[
        Path,
        typer.Argument(
            metavar="COUNTS", help="Counts and mean speeds of detectors, as coramp counts reads."
        ),
    ],
    model: Annotated[str, typer.Option(help="Car following: krauss, idm or eidm.")] = "krauss",
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the drivers, for coramp run --drivers FILE."),
    ] = None,
    runs: Annotated[int, typer.Option(min=12, help="Runs of the search.")] = 120,
    seeds: Annotated[int, typer.Option(min=1, help="Seeds 1 to N, by turns.")] = 16,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs at a time (default: one a core).")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the scenario."),
    ] = None,
    date: Annotated[str, typer.Option(help="A date to note in the file.")] = "",
    repair: Annotated[bool, typer.Option(help="Mend counts where that is possible.")] = False,
    json: Json = False,
    kmh: Kmh = False,
) -> None:
    """Fit drivers to the flows and speeds of detectors.

    The data should hold free traffic and a breakdown.
    """
    from coramp.calibration.effort import Effort
    from coramp.calibration.from_files import Asked, calibrated
    from coramp.calibration.models import model_checked
    from coramp.calibration.written import checked_out, write_population
    from coramp.cli.calibration_listing import calibrated_data, calibrated_table
    from coramp.cli.calibration_progress import CalibrationProgress
    from coramp.cli.console import print_json, print_table
    from coramp.scenarios.loading import load_scenario
    from coramp.scenarios.toml_files import parse_overrides
    from coramp.studies.runner import usable_cores
    from coramp.studies.speed_unit import KMH, MPS

    overrides = parse_overrides(settings or [])
    asked = Asked(model_checked(model), overrides, repair, date)
    if out is not None:
        checked_out(out)
    effort = Effort(runs, seeds, jobs or usable_cores())
    with CalibrationProgress(effort.total, effort.jobs) as progress:
        found, origin = calibrated(scenario, counts, asked, effort.told_to(progress))
    for note in found.notes:
        print(f"Note: {counts}: {note}", file=sys.stderr)
    if json:
        print_json(calibrated_data(found, "" if out is None else out.stem))
    else:
        v0_mps = load_scenario(scenario, overrides).mainline.speed_mps
        print_table(calibrated_table(found, asked.model, v0_mps, KMH if kmh else MPS))
    if out is not None:
        write_population(found, out, origin)
        if not json:
            print(f"The drivers are in {out}; coramp run {scenario} --drivers {out} uses them.")
