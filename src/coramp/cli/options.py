"""Exit codes, and options that several commands have."""

from typing import Annotated

import typer

from coramp.cli.completion import scenario_names, strategy_names

WRONG, USAGE, UNSAFE, STOPPED = 1, 2, 3, 130
DEBUG = "--debug"

Json = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
Wide = Annotated[
    bool, typer.Option("--wide", help="Print all columns of tables, not only those that fit.")
]
Kmh = Annotated[bool, typer.Option("--kmh", help="Show speeds in km/h.")]
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
