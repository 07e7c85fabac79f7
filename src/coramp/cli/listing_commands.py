"""Commands that tell what there is, and begin what is not: scenarios, strategies, new-strategy."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from coramp.cli.options import Json
from coramp.errors import printable

listing = typer.Typer(rich_markup_mode=None)


@listing.command(
    epilog="Example: coramp scenarios paper > my-ramp.toml\n\n"
    "Example: coramp scenarios my-ramp.toml"
)
def scenarios(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A built-in file, printed as a template for your own, or your own scenario, "
            "printed with all defaults."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """List built-in files, or print one, or complete your own."""
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


@listing.command(epilog="Example: coramp strategies")
def strategies(json: Json = False) -> None:
    """List the strategies and the packages that provide them."""
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


@listing.command("new-strategy", epilog="Example: coramp new-strategy mine && pip install ./mine")
def new_strategy(
    name: Annotated[str, typer.Argument(help="The strategy's name, such as mine.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write (default: ./NAME).")] = None,
) -> None:
    """Write a package with a strategy of your own and its test."""
    from coramp.cli.skeleton import write_skeleton

    folder = write_skeleton(name, out or Path(name))
    place = folder if folder.is_absolute() else f"./{folder}"
    print(f"Written: {folder}; now pip install {place}, and coramp run paper --strategy {name}")
