"""How results look on a terminal: tables on stdout, progress on stderr, JSON for machines."""

import dataclasses
import json
import shutil
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from coramp.api import CorridorStudyResult, PlanResult, RunResult, StudyResult
from coramp.audit.verdicts import Audit
from coramp.cli.run_table import run_table
from coramp.cli.table_text import text_lines
from coramp.cli.table_view import NARROW, fitted
from coramp.equations.printed import in_words
from coramp.explain.quantity import Quantity, printed_equations
from coramp.explain.story import Story, told
from coramp.records.schemas import Row
from coramp.records.world_told import told_of_world
from coramp.runs.running import finite_or_none
from coramp.studies.outlook import Outlook
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.tables import Table, number

if TYPE_CHECKING:
    from coramp.report.figures import FigureSet

WITHOUT_COMPILING = (
    "The expected duration leaves out compiling: the first runs after an installation take up to a "
    "few minutes more."
)


def print_json(data: Any) -> None:
    """Prints plain data as JSON."""
    print(json.dumps(finite_or_none(data), indent=2, allow_nan=False))


def print_table(table: Table, wide: bool = False) -> None:
    """Prints a table with its title above and its notes below.

    It has the columns that a terminal's width holds, elsewhere those of 80 characters, or all if
    ``wide``. What does not go to a terminal is not wrapped.
    """
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    shown = table if wide else fitted(table, width or NARROW)
    print("\n".join([*text_lines(shown, width), ""]))


def print_listing(found: Mapping[str, Mapping[str, str]]) -> None:
    """Prints names with what they are, by kind."""
    for kind, entries in found.items():
        print(f"{kind}:")
        width = max(len(name) for name in entries)
        for name, text in entries.items():
            print(f"  {name:<{width}}  {text}")


def counted(number: int, what: str) -> str:
    """Returns a number of things in words."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def tell_of_compiling() -> None:
    """Says on stderr why the first command of an installation takes so long."""
    from coramp._kernel import never_compiled

    if never_compiled():
        print("Compiling the kernels, once (a minute or two) ...", file=sys.stderr)


def tell_of_demand(line: str) -> None:
    """Says on stderr that more arrive than the lane carries."""
    print(f"Note: {line}", file=sys.stderr)


@contextmanager
def working(text: str) -> Iterator[None]:
    """Shows that something is under way, on a terminal only."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(text):
        yield


def print_run(
    result: RunResult, out: Path | None, wide: bool = False, unit: SpeedUnit = MPS
) -> None:
    """Prints the summary of a run, with speeds in a unit, and where its records lie."""
    print_table(run_table(result.summary, unit), wide)
    if told_of := told_of_world(result):
        print(f"The world: {told_of}.")
    if out is not None:
        told = f"coramp explain {out} VEHICLE explains one vehicle's plan"
        if result.on_board is not None:
            told = f"coramp explain {out} VEHICLE tells what one vehicle did, and why"
        elif result.decisions is None:
            told = f"coramp report {out} shows them"
        print(f"Records are in {out}; {told}.")


def print_audit(result: Audit, wide: bool = False) -> None:
    """Prints what an audit confirmed, and what not, one line a claim."""
    rows = tuple((check.claim, check.verdict, check.how) for check in result.checks)
    counts = Counter(check.verdict for check in result.checks)
    told = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    print_table(Table(f"{result.folder}: {told}", ("claim", "verdict", "how"), rows), wide)


def quantity_table(title: str, quantities: list[Quantity]) -> Table:
    """Returns quantities as a table."""
    rows = tuple((q.equation, q.symbol, q.meaning, q.text()) for q in quantities)
    return Table(title, ("Eq.", "symbol", "what", "value"), rows)


def print_quantities(title: str, quantities: list[Quantity], wide: bool = False) -> None:
    """Prints the quantities of a decision as a table, if there are any."""
    if quantities:
        print_table(quantity_table(title, quantities), wide)


def print_equations(quantities: list[Quantity]) -> None:
    """Prints the equations of quantities as the paper prints them, once each."""
    printed = printed_equations(quantities)
    if printed:
        print("Equations, as the paper prints them:")
    for equation, text in printed.items():
        print(f"  Eq. {equation}: {text}")


def print_tried(title: str, lines: list[str]) -> None:
    """Prints what was tried for a decision, one line an attempt."""
    print(f"{title}:")
    for line in lines:
        print(f"  {line}")


def print_plan(result: PlanResult, wide: bool = False) -> None:
    """Prints each ramp vehicle's decision with its quantities, then who was moved."""
    for decision in result.decisions.iter_rows(named=True):
        vehicle_id = decision["vehicle_id"]
        print(f"{vehicle_id}: {told(decision)}.")
        print_tried(f"Tried for {vehicle_id}", result.tried(vehicle_id))
        title = f"{vehicle_id}, rung {decision['rung']}"
        print_quantities(title, result.quantities(vehicle_id), wide)
        print(f"{_checked(decision['min_margin_m'])}\n")
    vehicles = result.decisions["vehicle_id"].to_list()
    print_equations([q for name in vehicles for q in result.quantities(name)])


def _checked(margin_m: float | None) -> str:
    if margin_m is None:
        return "Nothing new to check: every commitment stays as it was."
    margin = number(margin_m, 3)
    return f"Checked: every affected vehicle keeps {margin} m or more beyond the safe distance."


def plan_json(result: PlanResult) -> Row:
    """Returns a plan as plain data."""
    return {
        "kind": "plan",
        "snapshot": result.planned.snapshot.name,
        "strategy": result.planned.strategy,
        "decisions": [
            {
                **row,
                "tried": result.tried(row["vehicle_id"]),
                "quantities": [_quantity_json(q) for q in result.quantities(row["vehicle_id"])],
            }
            for row in result.decisions.iter_rows(named=True)
        ],
        "trajectories": result.trajectories.to_dicts(),
    }


def _quantity_json(quantity: Quantity) -> Row:
    return {
        "equation": quantity.equation,
        "symbol": quantity.symbol,
        "meaning": quantity.meaning,
        "value": quantity.value,
        "unit": quantity.unit,
        "printed": [in_words(equation) for equation in quantity.numbers],
    }


def print_story(story: Story, wide: bool = False) -> None:
    """Prints a vehicle's story."""
    vehicle = story.vehicle
    name = vehicle["vehicle_id"]
    print(f"{name} ({vehicle['stream']}), {story.run['scenario']}, {story.run['strategy']}")
    print(f"  {number(vehicle['scheduled_s'], 1)} s: due at the zone's start")
    if vehicle["entry_s"] is None:
        print("  never entered")
    else:
        waited = (
            f", after waiting {number(vehicle['waiting_s'], 1)} s" if vehicle["waiting_s"] else ""
        )
        print(f"  {number(vehicle['entry_s'], 1)} s: enters{waited}")
    events = [(c.decision["time_s"], c.text) for c in story.chapters]
    events += [(plan.time_s, plan.text) for plan in story.refused]
    events += [(row["time_s"], _moved(row)) for row in story.moved_for]
    for time_s, text in sorted(events):
        print(f"  {number(time_s, 1)} s: {text}")
    if vehicle["exit_s"] is not None:
        print(
            f"  {number(vehicle['exit_s'], 2)} s: leaves; delay {number(vehicle['delay_s'], 3)} s "
            f"of {number(vehicle['free_flow_s'], 1)} s, {number(vehicle['fuel_l'], 4)} l of fuel"
        )
    else:
        print("  not out when the run was cut off")
    print()
    for chapter in story.chapters:
        when, rung = number(chapter.decision["time_s"], 1), chapter.decision["rung"]
        print_tried(f"{name}, tried at {when} s", chapter.tried)
        print_quantities(f"{name}, decision at {when} s, rung {rung}", chapter.quantities, wide)
    for plan in story.refused:
        print_tried(f"{name}, tried at {number(plan.time_s, 1)} s and refused", plan.tried)
    print_equations([quantity for chapter in story.chapters for quantity in chapter.quantities])


def _moved(row: Row) -> str:
    shift_m = row["largest_shift_m"]
    if shift_m:
        return f"moves aside for {row['vehicle_id']} (largest shift then {number(shift_m)} m)"
    return f"brakes behind {row['vehicle_id']}"


def story_json(story: Story) -> Row:
    """Returns a story as plain data."""
    return {
        "kind": "story",
        "run": story.run,
        "vehicle": story.vehicle,
        "decisions": [
            {
                **chapter.decision,
                "told": chapter.text,
                "tried": chapter.tried,
                "quantities": [_quantity_json(q) for q in chapter.quantities],
            }
            for chapter in story.chapters
        ],
        "refused": [dataclasses.asdict(plan) for plan in story.refused],
        "moved_for": story.moved_for,
    }


def print_study(result: StudyResult, wide: bool = False) -> None:
    """Prints a study's tables and where they lie."""
    for table in result.tables:
        print_table(table, wide)
    rows = "sites" if isinstance(result, CorridorStudyResult) else "streams"
    print(f"Results are in {result.folder}: runs.parquet, {rows}.parquet, tables.md.")


def print_outlook(ahead: Outlook, wide: bool = False) -> None:
    """Prints how far a study is, and how long the rest should take."""
    rows = [
        ("folder", str(ahead.folder)),
        ("runs", str(ahead.runs)),
        ("done", str(ahead.done)),
        ("failed, to run again", str(ahead.failed)),
        ("damaged, to run again", str(ahead.damaged)),
        ("to run", str(ahead.missing)),
    ]
    if ahead.outdated:
        rows.append(("kept, but of the scenario file before it was changed", str(ahead.outdated)))
    if ahead.searches_at_most:
        rows.append(("more for breakdown searches, at most", str(ahead.searches_at_most)))
    rows.append(("expected duration (s)", f"{ahead.expected_s:.0f} (jobs: {ahead.jobs})"))
    notes = [WITHOUT_COMPILING] if ahead.missing else []
    if ahead.outdated:
        notes.append(
            "The scenario file has changed since: the tables and the report in the folder are of "
            "the old file. coramp study runs everything again that the change concerns."
        )
    print_table(Table("Outlook", ("what", "value"), tuple(rows), tuple(notes)), wide)


def outlook_json(ahead: Outlook) -> Row:
    """Returns an outlook as plain data."""
    return {
        "kind": "outlook",
        **dataclasses.asdict(ahead),
        "folder": str(ahead.folder),
        "missing": ahead.missing,
    }


def study_json(result: StudyResult) -> Row:
    """Returns a study as plain data."""
    return {
        "kind": "study",
        "folder": str(result.folder),
        "runs": result.runs.to_dicts(),
        "tables": [
            {"title": t.title, "columns": t.columns, "rows": t.rows, "notes": t.notes}
            for t in result.tables
        ],
    }


def print_figures(drawn: "FigureSet") -> None:
    """Prints which figures were drawn, where they lie, and what was left out."""
    for name, files in drawn.files.items():
        print(f"{name}: {', '.join(file.suffix.lstrip('.') for file in files)}")
    print(f"{counted(len(drawn.files), 'figure')} in {drawn.folder}.")
    for note in drawn.notes:
        print(f"Note: {note}.")


def figures_json(drawn: "FigureSet") -> Row:
    """Returns which figures were drawn as plain data."""
    files = {name: [str(file) for file in files] for name, files in drawn.files.items()}
    return {
        "kind": "figures",
        "folder": str(drawn.folder),
        "files": files,
        "notes": list(drawn.notes),
    }


def written(path: Path) -> None:
    """Prints where a page lies."""
    print(f"Written: {path} ({path.stat().st_size / 1e6:.1f} MB); open it in a browser.")


def serving(address: str, show: bool) -> None:
    """Prints where the studio's page lies, and opens it where that is asked for."""
    print(f"Studio: {address} (ctrl-c ends it)", flush=True)
    if show:
        import webbrowser

        webbrowser.open(address)
