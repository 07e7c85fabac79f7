"""The command line: parses, calls one function, prints."""

from typing import Annotated

import typer

from coramp.cli.calibration_commands import calibration
from coramp.cli.demand_commands import demand
from coramp.cli.listing_commands import listing
from coramp.cli.network_commands import networks
from coramp.cli.options import DEBUG
from coramp.cli.page_commands import showing
from coramp.cli.run_commands import computing

app = typer.Typer(
    name="coramp",
    help="Cooperative on-ramp merging: plan, simulate, compare and explain.",
    epilog="Example: coramp run paper --mainline 1500 --ramp 700 --seed 77 --out out/r",
    rich_markup_mode=None,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


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
        typer.Option("--version", is_eager=True, callback=_told_version, help="Show the version."),
    ] = False,
) -> None:
    """Cooperative on-ramp merging: plan, simulate, compare and explain."""


for commands in (listing, networks, demand, computing, calibration, showing):
    app.add_typer(commands)
