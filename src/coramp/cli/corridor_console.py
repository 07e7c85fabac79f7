"""The run of a corridor on the command line: from its options to its tables."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from coramp.api import CorridorResult, corridor
from coramp.cli.console import print_json, print_table, tell_of_compiling, tell_of_demand, working
from coramp.errors import CorampError
from coramp.records.schemas import Row
from coramp.runs.corridors import processes_checked
from coramp.scenarios.toml_files import parse_overrides
from coramp.studies.tables import Table, number

KEPT = ("site", "served", "delay (s)", "merges", "made way", "handed over")
"""Columns of the table of sites that a narrow terminal keeps first."""


def run_corridor_command(
    scenario: str,
    strategy: str,
    *,
    refused: Sequence[str],
    drivers: str | None,
    settings: Sequence[str],
    seed: int,
    horizon_s: float | None,
    processes: int | None,
    out: Path | None,
    keep_sumo: bool,
    gui: bool,
    json: bool,
    wide: bool,
) -> CorridorResult:
    """Runs a corridor, prints what came of it and returns that.

    Raises CorampError for options that are those of one merge site.
    """
    if "--keep-messages" in refused:
        raise CorampError(
            f"--keep-messages: {scenario} is a corridor, whose coordinators keep no messages; "
            "allowed is --keep-sumo, which keeps where all vehicles were"
        )
    if refused:
        raise CorampError(
            f"{refused[0]}: is for one merge site; {scenario} is a corridor: allowed is the "
            "scenario's [corridor], or --set with its keys"
        )
    overrides = parse_overrides(settings)
    if horizon_s is not None:
        if "simulation.horizon_s" in overrides:
            raise CorampError(
                "--set: simulation.horizon_s by --horizon and by --set: given twice; allowed is "
                "once"
            )
        overrides["simulation.horizon_s"] = float(horizon_s)
    processes = processes_checked(1 if processes is None else processes)
    tell_of_compiling()
    with working("running"):
        result = corridor(
            scenario,
            strategy,
            drivers=drivers,
            overrides=overrides,
            seed=seed,
            processes=processes,
            out=out,
            keep_sumo=keep_sumo,
            gui=gui,
            notice=tell_of_demand,
        )
    if json:
        print_json(result.content)
        return result
    print_table(sites_table(result), wide)
    print_table(totals_table(result.content), wide)
    if out is not None:
        print(f"Records are in {out}; coramp report {out} shows them.")
    return result


def sites_table(result: CorridorResult) -> Table:
    """Returns what happened at each site; of two numbers the first is the mainline's."""
    columns = (
        *("site", "zone (m)", "vehicles", "served", "delay (s)", "merges", "made way"),
        *("hard brakings", "stopped", "handed over", "handed on"),
    )
    rows = tuple(
        (
            str(row["site"]),
            number(row["zone_m"], 0),
            f"{row['mainline_vehicles']} + {row['ramp_vehicles']}",
            f"{row['mainline_served']} + {row['ramp_served']}",
            f"{number(row['mainline_delay_s'])}, {number(row['ramp_delay_s'])}",
            *(str(row[name]) for name in ("merges", "made_way", "hard_brakings_3")),
            *(str(row[name]) for name in ("stopped_vehicles", "taken_over", "handed_on")),
        )
        for row in result.sites.to_dicts()
    )
    content = result.content
    title = f"{content['scenario']}: {content['strategy']}, {content['drivers']} drivers, by site"
    notes = ("Of two numbers the first is of the mainline, the second of the ramp.",)
    return Table(title, columns, rows, notes, KEPT)


def totals_table(content: Mapping[str, object]) -> Table:
    """Returns what the run amounts to, as a table of two columns."""
    row = content["summary"]
    assert isinstance(row, dict)
    return Table("The corridor", ("figure", "value"), tuple(_totals(row)))


def _totals(row: Row) -> list[tuple[str, str]]:
    return [
        ("vehicles", str(row["vehicles"])),
        ("through", str(row["through"])),
        ("total time spent (h)", number(row["time_spent_s"] / 3600.0)),
        ("of that waiting to enter (h)", number(row["waiting_s"] / 3600.0)),
        ("delay (h)", number(row["delay_s"] / 3600.0)),
        ("delay a vehicle (s)", number(row["mean_delay_s"])),
        ("distance (km)", number(row["vehicle_km"], 1)),
        ("hand-overs", str(row["hand_overs"])),
        ("collisions", str(row["collisions"])),
        ("of these caused by automated vehicles", str(row["collisions_by_automated"])),
        ("most vehicles in zones at once", str(row["most_at_once"])),
    ]
