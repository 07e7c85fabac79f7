"""Commands that tell what there is in a SUMO network, and begin a scenario in it."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from coramp.cli.options import Json, Kmh, Wide
from coramp.errors import CorampError

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


@networks.command(
    "new-scenario",
    epilog="Example: coramp new-scenario a10 --net osm.net.xml --ramp 24498409@4054057\n\n"
    "Example: coramp new-scenario a10 --osm a10.osm.xml --ramp 24498409@4054057\n\n"
    "Example: coramp new-scenario morning --counts morning.csv --mainline-detector M "
    "--ramp-detector R --detector M=-350 --detector R=-300"
    "\n\nExample: coramp new-scenario road --net road.net.xml --ramp on1@m1 --ramp on2@m2",
)
def new_scenario(
    name: Annotated[str, typer.Argument(help="The scenario's name; NAME.toml is written.")],
    ramp: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID",
            help="The on-ramp, as coramp ramps has it (default: the one); several are a corridor.",
        ),
    ] = None,
    net: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A SUMO network, .net.xml or .net.xml.gz.")
    ] = None,
    osm: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="An extract of OpenStreetMap, for netconvert."),
    ] = None,
    road: Annotated[
        str | None,
        typer.Option(
            metavar="SCENARIO",
            help="With --counts: the road of this scenario (default: paper) instead of a network.",
        ),
    ] = None,
    counts: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Demand as counted; coramp counts shows such a file."),
    ] = None,
    mainline_detector: Annotated[
        str | None,
        typer.Option(
            metavar="ID",
            help="The detector of the mainline in --counts; several are one a lane, as in M0+M1, "
            "from the lane next to the ramp on.",
        ),
    ] = None,
    ramp_detector: Annotated[
        str | None, typer.Option(metavar="ID", help="The detector of the ramp in --counts.")
    ] = None,
    detector: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID=STATION",
            help="Where a detector is, in m from the nose (default: 50 m behind the entry); one "
            "of another name is a further one on the mainline.",
        ),
    ] = None,
    classes: Annotated[
        list[str] | None,
        typer.Option("--class", metavar="CLASS=TYPE", help="Of which type a class in --counts is."),
    ] = None,
    repair: Annotated[
        bool, typer.Option(help="Mend what does not add up in --counts, and list it.")
    ] = False,
) -> None:
    """Write a scenario of ramps in a network, or of counts.

    With --osm netconvert makes NAME.net.xml first, and its command is kept beside it.
    """
    from coramp.cli.new_scenario import Asked, write_asked

    stem = name.removesuffix(".toml")
    if not Path(stem).name.strip(". "):
        raise CorampError(f"name: {name!r} is none; allowed is the name of a file, like a10")
    target = Path(f"{stem}.toml")
    if target.exists():
        raise CorampError(f"{target}: is there already; give another name, or move it away")
    asked = Asked(
        *(ramp or [], net, osm, road, counts, mainline_detector, ramp_detector),
        *(detector or [], classes or [], repair),
    )
    for line in write_asked(asked, target):
        print(f"Repaired: {line}", file=sys.stderr)
    strategy = " --strategy mixed-slots" if net is not None or osm is not None else ""
    print(f"Written: {target}; now coramp run {target}{strategy}")
