"""How results look on a terminal: tables on stdout, progress on stderr, JSON for machines."""

import dataclasses
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table as RichTable

from coramp.api import PlanResult, RunResult, StudyResult
from coramp.audit.verdicts import Audit
from coramp.explain.decision import Quantity
from coramp.explain.story import Story, told
from coramp.records.schemas import Row
from coramp.runs.running import finite_or_none
from coramp.studies.outlook import Outlook
from coramp.studies.runner import Progress as StudyState
from coramp.studies.tables import Table, number

if TYPE_CHECKING:
    from coramp.report.figures import FigureSet

WIDE = 240
"""Columns of tables that do not go to a terminal."""
QUIET_REPORT_S = 10.0
"""How often progress is told where there is no terminal to draw a bar on."""


def _console() -> Console:
    return Console(highlight=False, width=None if sys.stdout.isatty() else WIDE)


def print_json(data: Any) -> None:
    """Prints plain data as JSON."""
    print(json.dumps(finite_or_none(data), indent=2, allow_nan=False))


def print_table(table: Table) -> None:
    """Prints a table with its title above and its notes below."""
    rich = RichTable(title=table.title, title_justify="left", box=box.SIMPLE_HEAD)
    for column in table.columns:
        rich.add_column(column, overflow="fold")
    for row in table.rows:
        rich.add_row(*row)
    console = _console()
    console.print(rich)
    for note in table.notes:
        console.print(note, markup=False)
    console.print()


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


def run_table(summary: Row) -> Table:
    """Returns the summary of a run as a table of two columns."""
    who = f"{summary['strategy']}"
    if summary["drivers"]:
        who += f", {summary['drivers']} drivers"
    lines = [
        ("delay of all (s): mean", number(summary["delay_s"])),
        *_bound_lines(summary),
        (
            "mainline delay (s): mean, 95th percentile",
            _two(summary, "mainline_delay_s", "mainline_delay_p95_s"),
        ),
        (
            "ramp delay (s): mean, 95th percentile",
            _two(summary, "ramp_delay_s", "ramp_delay_p95_s"),
        ),
        (
            "mainline speed (m/s): mean, over 1 s bins ±",
            _two(summary, "mainline_speed_mps", "mainline_speed_std_mps"),
        ),
        (
            "ramp speed (m/s): mean, over 1 s bins ±",
            _two(summary, "ramp_speed_mps", "ramp_speed_std_mps"),
        ),
        (
            "vehicles: mainline, ramp, unserved",
            f"{summary['vehicles_mainline']}, {summary['vehicles_ramp']}, {summary['unserved']}",
        ),
        ("fuel (l)", number(summary["fuel_l"])),
        (
            "collisions, safe-distance violations",
            f"{summary['collisions']}, {summary['safety_violations']}",
        ),
        ("smallest margin over the safe distance (m)", _margin(summary)),
        ("smallest TTC (s), largest DRAC (m/s2)", _two(summary, "min_ttc_s", "max_drac_mps2")),
        (
            "largest severity J (m2/s4), hardest braking (m/s2)",
            _two(summary, "max_severity", "max_decel_mps2"),
        ),
    ]
    lines += [
        (
            "brakings beyond 3 and 4.5 m/s2, vehicles that stopped",
            f"{summary['hard_brakings_3']}, {summary['hard_brakings_4_5']}, {summary['stops']}",
        ),
    ]
    if summary["drivers"] is None:
        rungs = ("free", "reach", "create", "delay", "hold")
        lines += [
            ("largest difference between plan and SUMO (m)", number(summary["plan_error_m"], 4)),
            ("commands that were not safe and replaced", str(summary["interventions"])),
        ]
        if any(summary[f"rung_{rung}"] for rung in rungs):
            by_rung = ", ".join(f"{rung} {summary[f'rung_{rung}']}" for rung in rungs)
            lines += [
                ("ramp vehicles by rung", by_rung),
                ("vehicles adjusted for others", str(summary["adjusted_vehicles"])),
            ]
    lines.append(("computed in (s)", number(summary["wall_s"])))
    title = (
        f"{summary['scenario']}: {who}, {summary['mainline_veh_h']:g} + {summary['ramp_veh_h']:g} "
        f"veh/h, seed {summary['seed']}"
    )
    return Table(title, ("what", "value"), tuple(lines))


def _bound_lines(summary: Row) -> list[tuple[str, str]]:
    if summary["lane_limit_veh_h"] is None:
        return []
    return [
        (
            "least delay that the lane allows (s), delay over that",
            _two(summary, "delay_bound_s", "delay_bound_ratio"),
        ),
        ("most that the lane carries (veh/h)", number(summary["lane_limit_veh_h"], 0)),
    ]


def _margin(summary: Row) -> str:
    """The least margin, with its equation where that is not Eq. 1."""
    equation = summary["min_margin_equation"]
    over = f", over Eq. {equation}" if equation not in (None, 1) else ""
    return f"{number(summary['min_margin_m'], 3)}{over}"


def _two(summary: Row, first: str, second: str) -> str:
    return f"{number(summary[first])}, {number(summary[second])}"


def print_run(result: RunResult, out: Path | None) -> None:
    """Prints the summary of a run and where its records lie."""
    print_table(run_table(result.summary))
    if out is not None:
        print(f"Records are in {out}; coramp explain {out} VEHICLE tells one vehicle's story.")


def print_audit(result: Audit) -> None:
    """Prints what an audit confirmed, and what not, one line a claim."""
    rows = tuple((check.claim, check.verdict, check.how) for check in result.checks)
    counts = Counter(check.verdict for check in result.checks)
    told = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    print_table(Table(f"{result.folder}: {told}", ("claim", "verdict", "how"), rows))


def quantity_table(title: str, quantities: list[Quantity]) -> Table:
    """Returns quantities as a table."""
    rows = tuple((q.equation, q.symbol, q.meaning, q.text()) for q in quantities)
    return Table(title, ("Eq.", "symbol", "what", "value"), rows)


def print_plan(result: PlanResult) -> None:
    """Prints each ramp vehicle's decision with its quantities, then who was moved."""
    for decision in result.decisions.iter_rows(named=True):
        vehicle_id = decision["vehicle_id"]
        print(f"{vehicle_id}: {told(decision)}.")
        title = f"{vehicle_id}, rung {decision['rung']}"
        print_table(quantity_table(title, result.quantities(vehicle_id)))
        print(f"{_checked(decision['min_margin_m'])}\n")


def _checked(margin_m: float | None) -> str:
    if margin_m is None:
        return "Nothing new to check: every commitment stays as it was."
    margin = number(margin_m, 3)
    return f"Checked: everyone affected keeps {margin} m or more beyond the safe distance."


def plan_json(result: PlanResult) -> Row:
    """Returns a plan as plain data."""
    return {
        "kind": "plan",
        "snapshot": result.planned.snapshot.name,
        "strategy": result.planned.strategy,
        "decisions": [
            {**row, "quantities": [_quantity_json(q) for q in result.quantities(row["vehicle_id"])]}
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
    }


def print_story(story: Story) -> None:
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
    events = [(c.decision["time_s"], told(c.decision)) for c in story.chapters]
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
        title = f"{name}, decision at {when} s, rung {rung}"
        print_table(quantity_table(title, chapter.quantities))


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
                "told": told(chapter.decision),
                "quantities": [_quantity_json(q) for q in chapter.quantities],
            }
            for chapter in story.chapters
        ],
        "moved_for": story.moved_for,
    }


def print_study(result: StudyResult) -> None:
    """Prints a study's tables and where they lie."""
    for table in result.tables:
        print_table(table)
    print(f"Results are in {result.folder}: runs.parquet, streams.parquet, tables.md.")


def print_outlook(ahead: Outlook) -> None:
    """Prints how far a study is, and how long the rest should take."""
    rows = [
        ("folder", str(ahead.folder)),
        ("runs", str(ahead.runs)),
        ("done", str(ahead.done)),
        ("failed, to run again", str(ahead.failed)),
        ("damaged, to run again", str(ahead.damaged)),
        ("to run", str(ahead.missing)),
    ]
    if ahead.searches_at_most:
        rows.append(("more for breakdown searches, at most", str(ahead.searches_at_most)))
    rows.append(("seconds for these, about", f"{ahead.expected_s:.0f} (jobs: {ahead.jobs})"))
    print_table(Table("Outlook", ("what", "value"), tuple(rows)))


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


class StudyProgress:
    """A bar with rate and remaining time, or a line now and then where there is no terminal."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, highlight=False)
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[last]}"),
            console=self._console,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task("runs", total=None, rate="", last="")
        self._started = time.monotonic()
        self._told = self._started

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def __call__(self, state: StudyState) -> None:
        """Shows how far the study is."""
        if state.last is None:
            self._begin(state)
            return
        elapsed_s = time.monotonic() - self._started
        rate = state.done / elapsed_s if elapsed_s > 0.0 else 0.0
        finished = state.skipped + state.done
        failed = f", {state.failed} failed" if state.failed else ""
        self._bar.update(
            self._task,
            completed=finished,
            total=state.total,
            rate=f"{rate:.1f}/s{failed}",
            last=_last(state),
        )
        if not self._console.is_terminal and (
            finished == state.total or time.monotonic() - self._told > QUIET_REPORT_S
        ):
            self._told = time.monotonic()
            left_s = (state.total - finished) / rate if rate else 0.0
            self._console.print(
                f"{finished} of {state.total} runs{failed}, {rate:.1f}/s, {left_s:.0f} s left"
            )

    def _begin(self, state: StudyState) -> None:
        self._started = self._told = time.monotonic()
        if state.skipped:
            self._console.print(f"{state.skipped} of {state.total} runs are there already")
        if state.damaged:
            self._console.print(f"{counted(state.damaged, 'result')} found damaged, to run again")
        self._bar.update(self._task, completed=state.skipped, total=state.total)


def _last(state: StudyState) -> str:
    if state.last is None:
        return ""
    run = state.last.run
    flows = f"{run['mainline_veh_h']:g}+{run['ramp_veh_h']:g}"
    delays = f"{number(run['mainline_delay_s'])}/{number(run['ramp_delay_s'])} s"
    return f"{run['strategy']} {flows}: {delays if run['status'] == 'ok' else run['error']}"
