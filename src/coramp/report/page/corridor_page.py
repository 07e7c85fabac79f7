"""The report of a corridor's run, alone or beside another on the same arrivals."""

import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace

import polars as pl

from coramp.agency.corridor_contour import contours_of
from coramp.errors import CorampError
from coramp.records.corridor_run import CorridorRecords
from coramp.records.schemas import Row
from coramp.report.corridor_figures import contour_figure, run_delay_figure
from coramp.report.page.assemble import plain
from coramp.report.page.study_answer import Answer
from coramp.report.page.svg import picture
from coramp.runs.corridor_rows import SHARES, trip_figures
from coramp.runs.corridors import broken_on_corridor
from coramp.scenarios.toml_files import override_text
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.tables import Table, number

HOUR_S = 3600.0
BY_SITE = (
    "A vehicle is served by a site once it has left its zone. Delay is the mean time in the zone "
    "beyond that of driving freely; below 0 for drivers who are faster than the limit. Made way: "
    "changes to a lane further in by command. Fallbacks: vehicles that did without commands, as "
    "too many were lost."
)
TRIPS = "From: the upstream end of a road, or the ramp of a site. To: the exit's edge, or the end."
WHOLE_NOTE = (
    "Delays are means over all vehicles, waiting to enter included. Travel times are from when a "
    "vehicle is due until it leaves, of those that left. Hand-overs: how often a coordinator takes "
    "over an automated vehicle, or leaves it to SUMO."
)
SPEEDS = "Speed along the road: vehicles drive upwards, red is slow, white is where nobody was"
NO_POSITIONS = "There is no picture of speeds along the road: run with --keep-sumo for it."


def corridor_page(runs: Sequence[CorridorRecords], unit: SpeedUnit = MPS) -> str:
    """Returns the report of the first run; others on the same arrivals stand beside it.

    Speeds are in a unit. Raises CorampError where arrivals differ, or a network cannot be read.
    """
    check_same_vehicles(runs)
    first, names = runs[0], [title_of(run) for run in runs]
    versions = tuple((key, str(value)) for key, value in first.content["versions"].items())
    return plain(
        "corridor.html",
        runs={},
        title=f"Report: {' against '.join(names)}",
        subtitle=subtitle_of(first),
        answer=answer(runs),
        notes=[line for run in runs for line in _notes(run)],
        tables=[_whole(runs)],
        shown=[
            ("Site by site", _noted([_sites(run) for run in runs], BY_SITE)),
            ("Travel times", _noted([_trips(run) for run in runs], TRIPS)),
        ],
        asked=_asked(first),
        pictures=list(_pictures(runs, names, unit)),
        failed=None,
        sure=[_sure(first)],
        versions=Table("Versions", ("what", "version"), versions),
        repeat="\n".join([*map(_repeat, runs), "# run.json has the full specification"]),
        files={},
    )


def subtitle_of(run: CorridorRecords) -> str:
    """Returns where and how long vehicles arrive, and the seed."""
    content = run.content
    sites = len(content["sites"])
    return (
        f"{content['scenario']}, {sites} merge site{'s' if sites > 1 else ''}, seed "
        f"{content['seed']}, {run.horizon_s:g} s of arrivals"
    )


def title_of(run: CorridorRecords) -> str:
    """Returns what the run is called beside others on the same arrivals."""
    automated = run.frames["trips"]["automated"]
    who = f"{100.0 * float(automated.mean() or 0.0):.0f} % automated"  # type: ignore[arg-type]
    return f"{run.content['strategy']} ({who})"


def check_same_vehicles(runs: Sequence[CorridorRecords]) -> None:
    """Raises CorampError where vehicles of the runs do not arrive at the same times."""
    columns = ["vehicle_id", "origin", "scheduled_s"]
    for run in runs[1:]:
        if not run.frames["trips"].select(columns).equals(runs[0].frames["trips"].select(columns)):
            raise CorampError(
                f"--against: other vehicles arrive there ({subtitle_of(run)}; here "
                f"{subtitle_of(runs[0])}); allowed are runs of the same flows, seed and horizon"
            )


def answer(runs: Sequence[CorridorRecords]) -> Answer:
    """Returns what runs say, an item each, and by how much the first is better than others."""
    first = runs[0]
    lead = (
        f"{first.summary['vehicles']} vehicles came in {first.horizon_s / 60.0:g} minutes to a "
        f"corridor with {len(first.content['sites'])} merge sites."
    )
    items = tuple((title_of(run), _told(run)) for run in runs)
    return Answer(lead, items, " ".join(_difference(runs)))


def _told(run: CorridorRecords) -> str:
    """In sentences what a run says."""
    row, left = run.summary, run.summary["unserved"]
    served = "all vehicles got through" if not left else f"{left} vehicles did not get through"
    worst = max(run.content["sites"], key=_worst)
    crashed = (
        "Nobody collides."
        if not row["collisions"]
        else f"There are {row['collisions']} collisions; automated vehicles caused "
        f"{row['collisions_by_automated']}."
    )
    return (
        f"{served}. Together they spend {number(row['time_spent_s'] / HOUR_S)} hours, "
        f"{number(row['delay_s'] / HOUR_S)} of them as delay: {number(row['mean_delay_s'])} s a "
        f"vehicle. Most is lost at {worst['site']}: {number(worst['mainline_delay_s'])} s on the "
        f"mainline and {number(worst['ramp_delay_s'])} s on the ramp on average. {crashed}"
    )


def _worst(site: Row) -> float:
    """What all vehicles that a site has served lose together (s)."""
    return math.fsum(
        (site[f"{stream}_delay_s"] or 0.0) * site[f"{stream}_served"]
        for stream in ("mainline", "ramp")
    )


def _difference(runs: Sequence[CorridorRecords]) -> Iterator[str]:
    for other in runs[1:]:
        by_s = (other.summary["mean_delay_s"] or 0.0) - (runs[0].summary["mean_delay_s"] or 0.0)
        word = "less" if by_s >= 0.0 else "more"
        yield (
            f"On the same arrivals, a vehicle loses {number(abs(by_s))} s {word} with "
            f"{title_of(runs[0])} than with {title_of(other)}."
        )


def _notes(run: CorridorRecords) -> Iterator[str]:
    if broken := broken_on_corridor(run.summary):
        yield f"Unsafe, {title_of(run)}: {'; '.join(broken)}."
    if not run.has_positions:
        yield NO_POSITIONS


def _whole(runs: Sequence[CorridorRecords]) -> Table:
    """The corridor's figures, a column a run."""
    columns = [dict(_figures(run)) for run in runs]
    rows = tuple((what, *(own[what] for own in columns)) for what in columns[0])
    names = tuple(title_of(run) for run in runs)
    return Table("The whole corridor", ("what", *names), rows, (WHOLE_NOTE,))


def _figures(run: CorridorRecords) -> Iterator[tuple[str, str]]:
    row = run.summary
    trips = trip_figures(run.frames["trips"], run.frames["sites"]["site"].to_list())
    fallbacks = run.frames["sites"]["fallbacks"].drop_nulls()
    yield "vehicles", str(row["vehicles"])
    yield "not through when the run was cut off", str(row["unserved"])
    yield "delay a vehicle (s)", number(row["mean_delay_s"])
    yield "of those from upstream ends (s)", number(trips["mainline_delay_s"])
    yield "of those from ramps (s)", number(trips["ramp_delay_s"])
    yield "total time spent (h)", number(row["time_spent_s"] / HOUR_S)
    yield "of that waiting to enter (h)", number(row["waiting_s"] / HOUR_S)
    yield "travel time, median (s)", number(trips["travel_p50_s"], 1)
    yield "travel time that 95 % keep below (s)", number(trips["travel_p95_s"], 1)
    yield "distance driven (km)", number(row["vehicle_km"], 1)
    yield "collisions", str(row["collisions"])
    yield "of these caused by automated vehicles", str(row["collisions_by_automated"])
    yield "brakings beyond 3 m/s²", str(row["hard_brakings_3"])
    yield "vehicles that stopped in a zone", str(row["stopped_vehicles"])
    yield "hand-overs", str(row["hand_overs"])
    yield "fallbacks on board", str(int(fallbacks.sum())) if len(fallbacks) else "-"


def _sites(run: CorridorRecords) -> Table:
    rows = tuple(
        (
            f"{k}: {row['site']}",
            *(number(row[f"{stream}_delay_s"]) for stream in ("mainline", "ramp")),
            f"{row['mainline_served']} + {row['ramp_served']}",
            f"{row['mainline_vehicles']} + {row['ramp_vehicles']}",
            *(str(row[key]) for key in ("merges", "made_way", "hard_brakings_3")),
            str(row["stopped_vehicles"]),
            f"{row['taken_over']}, {row['handed_on']}",
            "-" if row["fallbacks"] is None else str(row["fallbacks"]),
        )
        for k, row in enumerate(run.content["sites"], 1)
    )
    columns = (
        *("site", "delay, mainline (s)", "delay, ramp (s)", "served, mainline + ramp"),
        *("entered", "merges", "made way", "hard brakings", "stopped"),
        *("handed over, handed on", "fallbacks"),
    )
    return Table(f"By site: {title_of(run)}", columns, rows)


def _noted(tables: Sequence[Table], note: str) -> list[Table]:
    """Tables of several runs, with the note below the last alone."""
    return [*tables[:-1], replace(tables[-1], notes=(note,))]


def _trips(run: CorridorRecords) -> Table:
    """Travel times by where vehicles come from and where they leave."""
    travel = pl.col("left_s") - pl.col("scheduled_s")
    found = (
        run.frames["trips"]
        .group_by("origin", "leaves_by", maintain_order=True)
        .agg(
            pl.len().alias("vehicles"),
            pl.col("left_s").is_not_null().sum().alias("through"),
            *(travel.quantile(share, "linear").alias(name) for name, share in SHARES.items()),
            pl.col("delay_s").mean(),
        )
        .sort("origin", pl.col("leaves_by").fill_null(""))
    )
    rows = tuple(
        (
            str(row["origin"]),
            str(row["leaves_by"] or "end of the road"),
            str(row["vehicles"]),
            str(row["through"]),
            *(number(row[name], 1) for name in SHARES),
            number(row["delay_s"]),
        )
        for row in found.iter_rows(named=True)
    )
    columns = (
        *("from", "to", "vehicles", "through", "travel time, median (s)"),
        *("travel time, 95 % (s)", "delay (s)"),
    )
    return Table(f"Travel times: {title_of(run)}", columns, rows)


def _asked(run: CorridorRecords) -> Table:
    specification = run.content["specification"]
    section = specification["corridor"]
    trips = run.frames["trips"]
    shares = ", ".join(f"{way['edge']} {100 * way['share']:g} %" for way in section["exits"])
    rows = (
        ("scenario", str(run.content["scenario"])),
        ("network", str(section["file"])),
        ("sites", ", ".join(section["sites"])),
        ("flow at upstream ends (veh/h)", _listed(section["mainline_flow_veh_h"])),
        ("flow of ramps (veh/h)", _listed(section["ramp_flow_veh_h"])),
        ("exits, share of those that pass", shares or "none"),
        ("vehicles", f"{trips['automated'].sum()} of {trips.height} automated"),
        ("drivers", str(run.content["drivers"])),
        ("arrivals", f"{run.horizon_s:g} s, seed {run.content['seed']}"),
    )
    return Table("Road and traffic of this run", ("what", "value"), rows)


def _listed(flows: object) -> str:
    many = flows if isinstance(flows, list | tuple) else [flows]
    return ", ".join(f"{flow:g}" for flow in many)


def _pictures(
    runs: Sequence[CorridorRecords], names: Sequence[str], unit: SpeedUnit
) -> Iterator[Row]:
    yield picture("Delay by site", run_delay_figure(runs, names))
    contours = [(name, contours_of(run)) for run, name in zip(runs, names, strict=True)]
    if drawn := [(name, roads) for name, roads in contours if roads]:
        yield picture(SPEEDS, contour_figure(drawn, unit))


def _sure(run: CorridorRecords) -> str:
    return (
        f"This is one seed ({run.content['seed']}), one draw of arrivals: it has no interval. A "
        "study of several seeds gives one (coramp study with this scenario)."
    )


def _repeat(run: CorridorRecords) -> str:
    """The command that runs it again; the scenario is taken to lie in NAME.toml."""
    content = run.content
    words = ["coramp", "run", f"{content['scenario']}.toml", "--strategy", content["strategy"]]
    words += ["--drivers", content["drivers"], "--seed", str(content["seed"])]
    for key, value in (content.get("settings") or {}).items():
        words += ["--set", override_text(key, value)]
    return shlex.join(words)
