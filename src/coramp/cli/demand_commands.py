"""Commands on measured demand."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from coramp.cli.options import WRONG, Json, Kmh, Wide
from coramp.errors import CorampError

demand = typer.Typer(rich_markup_mode=None)


@demand.command(
    epilog="Example: coramp counts morning.csv\n\n"
    "Example: coramp counts morning.csv --upstream M --upstream R --downstream D --repair"
)
def counts(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Counts of detectors: CSV, Parquet, or one of SUMO's own files (dfrouter, "
            "induction loops, routes, flows).",
        ),
    ],
    lanes: Annotated[
        int | None, typer.Option(min=1, max=9, help="Lanes of detectors whose counts name none.")
    ] = None,
    upstream: Annotated[
        list[str] | None, typer.Option(metavar="ID", help="A detector upstream of --downstream.")
    ] = None,
    downstream: Annotated[
        str | None, typer.Option(metavar="ID", help="A detector that must count no less.")
    ] = None,
    repair: Annotated[bool, typer.Option(help="Mend what can be mended, and list it.")] = False,
    json: Json = False,
    wide: Wide = False,
    kmh: Kmh = False,
) -> None:
    """List what a file of counts holds, and what does not add up."""
    from coramp.cli.console import print_json, print_table
    from coramp.cli.counts_listing import counts_data, counts_rows, counts_table
    from coramp.counts.reading import examined
    from coramp.studies.speed_unit import KMH, MPS

    if (downstream is None) != (not upstream):
        raise CorampError("--upstream, --downstream: allowed are both, or neither")
    found = examined(file, repair, lanes, upstream=upstream or (), downstream=downstream)
    rows = counts_rows(found)
    if json:
        print_json(counts_data(found, rows))
    elif rows:
        print_table(counts_table(found, rows, KMH if kmh else MPS), wide)
    if found.problems:
        for line in found.told:
            print(f"Error: {line}", file=sys.stderr)
        raise typer.Exit(WRONG)
