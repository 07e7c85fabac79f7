"""The pages of runs: report and replay of one run, or of several on the same arrivals."""

from collections.abc import Sequence
from typing import Any

from coramp.agency.before_after import Measured, Pairs
from coramp.errors import CorampError
from coramp.records.run import RunRecords
from coramp.records.schemas import MIXED_METRICS, Row
from coramp.report.page.asked import asked_table
from coramp.report.page.assemble import assembled, packed
from coramp.report.page.over_time import over_time_pictures
from coramp.report.page.shown import title_of
from coramp.report.page.summary import summary_of, summary_of_pairs
from coramp.road.streams import STREAMS
from coramp.runs.running import broken_promises
from coramp.studies.metric_labels import LABELS, RUNG_COLUMNS, in_unit, label_of, typeset
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.tables import Table, number

SHOWN = (
    *("delay_s", "delay_bound_s", "delay_bound_ratio"),
    *("mainline_delay_s", "mainline_delay_p95_s", "ramp_delay_s", "ramp_delay_p95_s"),
    *("mainline_speed_mps", "ramp_speed_mps", "mainline_fcfs_delay_s", "ramp_fcfs_delay_s"),
    *("lane_limit_veh_h", "fuel_l", "vehicles_mainline", "vehicles_ramp", "unserved"),
    *("collisions", "safety_violations", "min_margin_m", "min_margin_equation"),
    *("min_merge_margin_m", "min_ttc_s", "max_decel_mps2", "hard_brakings_3"),
    *("hard_brakings_4_5", "stops", *MIXED_METRICS, "plan_error_m", *RUNG_COLUMNS.values()),
)
"""The figures of a run that its page has, in order."""
MEANS = "Delays and speeds are means over vehicles, but for percentiles."


def replay_page(runs: Sequence[RunRecords]) -> str:
    """Returns a page with the replay and the time-space diagrams of runs on the same arrivals.

    Raises CorampError where their arrivals differ.
    """
    check_same_arrivals(runs)
    return assembled("replay.html", **_frame("Replay", runs))


def run_page(
    runs: Sequence[RunRecords], versions: Row, repeat: Sequence[str], unit: SpeedUnit = MPS
) -> str:
    """Returns the report of the first run; others on the same arrivals stand beside it.

    ``versions`` are those that it was computed with, ``repeat`` the commands that do it again;
    speeds are in a unit.
    Raises CorampError where their arrivals differ.
    """
    check_same_arrivals(runs)
    return assembled(
        "run.html",
        **_frame("Report", runs),
        asked=asked_table(runs[0], unit),
        answer=" ".join([answer(run) for run in runs] + _difference(runs)),
        notes=[line for run in runs for line in notes(run)],
        tables=[comparison_table(runs, unit)],
        pictures=over_time_pictures(runs, unit),
        sure=_how_sure(runs),
        versions=Table("Versions", ("what", "version"), tuple(map(_texts, versions.items()))),
        repeat="\n".join(repeat),
        files={},
        mixed=any(run.is_mixed for run in runs),
        summary=summary_of([Measured(run) for run in runs], unit),
    )


def compared_page(pairs: Pairs, unit: SpeedUnit = MPS) -> str:
    """Returns the page of the summary alone, of runs before and after, a pair a seed."""
    before, after = (measured.run for measured in pairs[0])
    seeds = ", ".join(str(one.run.summary["seed"]) for one, _ in pairs)
    return assembled(
        "summary.html",
        title=f"Before and after: {title_of(before)}, {title_of(after)}",
        subtitle=f"{after.scenario.name}, {after.flows}, seeds {seeds}",
        runs={},
        cells=[],
        summary=summary_of_pairs(pairs, unit),
    )


def check_same_arrivals(runs: Sequence[RunRecords]) -> None:
    """Raises CorampError where vehicles of the runs do not arrive at the same times."""
    columns = ["vehicle_id", "scheduled_s"]
    for run in runs[1:]:
        if not run.vehicles.select(columns).equals(runs[0].vehicles.select(columns)):
            raise CorampError(
                f"--against: other vehicles arrive there ({_other_arrivals(runs[0], run)}); "
                "allowed are runs of the same flows, seed and horizon, or of the same list"
            )


def _other_arrivals(here: RunRecords, there: RunRecords) -> str:
    """What two runs whose arrivals differ do not share: what was asked, or else who comes when."""
    one, other = (
        (
            r.flows,
            f"seed {r.summary['seed']}",
            f"{r.scenario.simulation.horizon_s:g} s",
            "listed" if r.scenario.arrivals else "drawn",
            f"{r.vehicles.height} vehicles",
        )
        for r in (here, there)
    )
    differing = [(mine, its) for mine, its in zip(one, other, strict=True) if mine != its]
    if differing:
        return "; ".join(f"here {mine}, there {its}" for mine, its in differing)
    due = [dict(r.vehicles.select("vehicle_id", "scheduled_s").iter_rows()) for r in (here, there)]
    name = min(name for name in due[0] if due[0][name] != due[1].get(name))
    its_s = f"there at {due[1][name]:g} s" if name in due[1] else "there never"
    return f"such as {name}: here due at {due[0][name]:g} s, {its_s}"


def _frame(kind: str, runs: Sequence[RunRecords]) -> Row:
    first = runs[0]
    keys = {f"run-{k}": packed(run) for k, run in enumerate(runs)}
    return {
        "title": f"{kind}: {' against '.join(title_of(run) for run in runs)}",
        "subtitle": f"{first.scenario.name}, {first.flows}, seed {first.summary['seed']}, "
        f"{first.scenario.simulation.horizon_s:g} s of arrivals",
        "scenarios": [run.scenario for run in runs],
        "runs": keys,
        "cells": [{"flow": first.flows, "runs": {key: key for key in keys}}],
    }


def _texts(pair: tuple[str, object]) -> tuple[str, str]:
    return pair[0], str(pair[1])


def answer(run: RunRecords) -> str:
    """Returns in a sentence what the run says."""
    row = run.summary
    left = row["unserved"]
    served = "every vehicle got through" if not left else f"{left} vehicles did not get through"
    return (
        f"With {title_of(run)}, at {run.flows}, vehicles lose {number(row['mainline_delay_s'])} s "
        f"on the mainline and {number(row['ramp_delay_s'])} s on the ramp on average, and {served}."
        f"{_against_the_bound(row)}"
    )


def _against_the_bound(row: Row) -> str:
    ratio = row.get("delay_bound_ratio")
    if ratio is None:
        return ""
    return (
        f" All together lose {number(row['delay_s'])} s, {number(ratio)} times the "
        f"{number(row['delay_bound_s'])} s that the lane allows at best."
    )


def _difference(runs: Sequence[RunRecords]) -> list[str]:
    if len(runs) < 2:
        return []
    one, other = runs[0].summary, runs[1].summary
    parts = []
    for stream in STREAMS:
        first, second = one[f"{stream}_delay_s"], other[f"{stream}_delay_s"]
        if first is not None and second is not None:
            word = "less" if first <= second else "more"
            parts.append(f"{abs(second - first):.2f} s {word} on the {stream}")
    return (
        [f"On the same arrivals, with {title_of(runs[0])} they lose {' and '.join(parts)}."]
        if parts
        else []
    )


def notes(run: RunRecords) -> list[str]:
    """Returns the warnings that a run's page shows first."""
    row, found = run.summary, []
    broken = broken_promises(row)
    if broken:
        found.append(f"Unsafe, {title_of(run)}: {'; '.join(broken)}.")
    if run.is_mixed and row["safety_violations"] and row["plan_error_m"] is not None:
        found.append(
            f"{title_of(run)}: {row['safety_violations']} pairs came nearer than the safe distance "
            "of Eq. 1, 15 and 16; they are ringed below. Neither drivers nor automated vehicles "
            "among them keep it: these keep the distance to stop behind a leader that brakes."
        )
    elif row["safety_violations"] and not broken:
        who = "vehicles that nobody coordinates" if run.is_mixed else "their drivers"
        found.append(
            f"{title_of(run)}: {row['safety_violations']} pairs came nearer than the safe distance "
            f"of Eq. 1, 15 and 16, which {who} do not know of; they are ringed below."
        )
    return found


def comparison_table(runs: Sequence[RunRecords], unit: SpeedUnit = MPS) -> Table:
    """Returns the figures of runs side by side; speeds in a unit."""
    rows = tuple(
        (
            typeset(label_of(key, unit)),
            *(number(in_unit(_computed(r, key), key, unit), LABELS[key].digits) for r in runs),
        )
        for key in SHOWN
        if any(_computed(run, key) is not None for run in runs)
    )
    columns = ("what", *(title_of(run) for run in runs))
    return Table("Figures", columns, rows, (MEANS,))


def _computed(run: RunRecords, key: str) -> Any:
    """A figure of a run, None where it was not computed: the exact engine drives no plan."""
    drives = run.summary["engine"] == "sumo"
    return run.summary.get(key) if drives or key != "plan_error_m" else None


def _how_sure(runs: Sequence[RunRecords]) -> list[str]:
    one_draw = (
        f"This is one seed ({runs[0].summary['seed']}), one draw of arrivals and entry speeds: "
        "it has no interval. A study of several seeds gives one (coramp study)."
    )
    if runs[0].scenario.arrivals:
        one_draw = (
            "Arrivals are listed: another seed changes drivers alone, and nothing where all "
            "cooperate. There is no interval over other arrivals."
        )
    return [
        one_draw,
        (
            "Within the run the figures are exact for what was driven: delays, fuel and margins "
            "come from pieces of constant acceleration in closed form."
        ),
    ]
