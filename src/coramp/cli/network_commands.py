"""Commands that tell what there is in a SUMO network."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from coramp.cli.options import Json, Kmh, Wide

networks = typer.Typer(rich_markup_mode=None)


@networks.command(
    epilog="Example: coramp ramps city.net.xml.gz\n\n"
    "Example: coramp ramps city.net.xml --plot ramps.png"
)
def ramps(
    network: Annotated[
        Path, typer.Argument(metavar="NET", help="A SUMO network, .net.xml or .net.xml.gz.")
    ],
    ramp: Annotated[
        str | None, typer.Option(metavar="ID", help="Only the on-ramp of this id.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw every on-ramp (png, svg or pdf).")] = None,
    json: Json = False,
    wide: Wide = False,
    kmh: Kmh = False,
) -> None:
    """List the on-ramps of a SUMO network.

    With each stands whether coramp can coordinate it, or why not.
    """
    from coramp.cli.console import print_json, print_table
    from coramp.cli.ramp_listing import listed, notes_on, only, ramp_rows, ramp_table
    from coramp.networks.net_file import read_network
    from coramp.networks.ramps import on_ramps
    from coramp.studies.speed_unit import KMH, MPS

    read = read_network(network)
    found = on_ramps(read)
    if ramp is not None:
        found = only(found, ramp, network)
    rows = ramp_rows(found)
    if plot is not None:
        from coramp.report.ramps_figure import save_ramps_figure

        save_ramps_figure(read, found, plot)
    for note in notes_on(read, found):
        print(f"Note: {network}: {note}", file=sys.stderr)
    if json:
        print_json(rows)
    elif rows:
        print_table(ramp_table(listed(network, rows), rows, KMH if kmh else MPS), wide)
    else:
        print(listed(network, rows))
