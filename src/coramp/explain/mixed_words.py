"""What a vehicle of mixed traffic did and what was known of others, in plain English."""

import math
from collections.abc import Sequence

import polars as pl

from coramp.explain.mixed_gaps import Drove
from coramp.mixed import binding as b
from coramp.mixed.users import Gaps
from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.road.lanes import mainline_lane

CRUISES, STOPS, FOLLOWS, KEEPS, TOLD, CHANGES, BROKEN = b.LAWS
SIDES = {"front": "ahead", "rear": "behind"}
NEAR_M, NOW_S = 0.05, 0.05
"""What is no more wrong and no older than this is known as it was."""


def assumed(drove: Drove) -> list[str]:
    """Returns what the laws take for granted, a line each, with their numbers in this run."""
    laws, scenario = drove.laws, drove.run.scenario
    safety, gaps = laws.safety, laws.gaps
    behind_m, behind_s = gaps.behind_automated_m, gaps.behind_automated_s
    lines = [
        (
            f"Whoever is ahead brakes at {safety.braking_mps2:g} m/s2 at most; it reacts after "
            f"{safety.reaction_s:g} s, brakes as hard, and has {safety.margin_m:g} m to spare."
        ),
        (
            f"Behind an automated vehicle it keeps {behind_m:g} m + {behind_s:.2f} s, behind a "
            f"driver {gaps.behind_driver_m:g} m + {gaps.behind_driver_s:.2f} s; for a driver who "
            f"is to merge it leaves {gaps.for_driver_m:g} m + {gaps.for_driver_s:g} s."
        ),
        (
            f"A driver keeps {gaps.of_driver_m:g} m + {_of_drivers(gaps)}, and brakes at "
            f"{safety.driver_mps2:g} m/s2 at most for who merges ahead of him."
        ),
        (
            f"Until it has merged it can stop with {safety.stop_mps2:g} m/s2 before station "
            f"{safety.lane_end_m:g} m."
        ),
    ]
    if drove.delay_s > 0.0:
        lines.append(
            f"A command acts {drove.delay_s:.2f} s late (dead time "
            f"{scenario.actuators.dead_time_s:g} s, lag {scenario.actuators.lag_s:g} s), which it "
            "reckons with."
        )
    if drove.run.heard is not None:
        lines.append(
            f"Who reports goes on as reported, for {scenario.reports.stale_s:g} s at "
            f"most; a command counts for {scenario.commands.valid_s:g} s."
        )
    return lines


def _of_drivers(gaps: Gaps) -> str:
    """Returns the time gaps of drivers in words."""
    if gaps.least_of_driver_s == gaps.of_driver_s:
        return f"{gaps.of_driver_s:g} s"
    return f"{gaps.of_driver_s:g} s on average (at least {gaps.least_of_driver_s:g} s)"


def done(row: Row, drove: Drove) -> str:
    """Returns what a vehicle did at a decision, and by which law."""
    text = ""
    if not row["changes_lane"]:
        text = place_of(row) if row["lane"] == "ramp" else _further_in(row)
    if row["law"] is None:
        return f"a driver, {text}" if text else "a driver"
    did = _changes(row) if row["changes_lane"] else _law(row, drove)
    if row["fallback"]:
        did = f"fallback, its command of {row['given_s']:.1f} s has expired: {did}"
    return f"{text}: {did}" if text else did


def place_of(row: Row) -> str:
    """Returns where in the order of passing a vehicle on the ramp was placed."""
    if row["place"] is None:
        return "without a place, as it is not known to the coordinator"
    if row["after_vehicle_id"] is None:
        return "placed ahead of everybody"
    return f"placed behind {row['after_vehicle_id']}"


def _further_in(row: Row) -> str:
    """Returns the lane of a vehicle that is not in the lane next to the ramp."""
    lane = mainline_lane(row["lane"])
    return f"in lane {lane + 1} from the ramp" if lane > 0 else ""


def _law(row: Row, drove: Drove) -> str:
    leader, law = row["leader_vehicle_id"], row["law"]
    if law == FOLLOWS:
        return f"follows {leader}, {row['leader_gap_m']:.1f} m ahead"
    if law == KEEPS:
        return f"keeps its distance to {leader}, {row['leader_gap_m']:.1f} m ahead"
    if law == TOLD:
        return f"{_courtesy(row, drove)} (told {_number(row['told_mps2'])} m/s2 at most)"
    if law == STOPS:
        return "slows down so that it could stop before the acceleration lane ends"
    if law == CHANGES:
        return "makes way for who changes lanes ahead of it"
    if law == BROKEN:
        return "has broken down"
    return f"goes to its own speed, at {row['speed_mps']:.1f} m/s now"


def _courtesy(row: Row, drove: Drove) -> str:
    """What it is told to slow down for."""
    after = row["after_vehicle_id"]
    if row["lane"] == "ramp":
        return f"falls in behind {after}" if after else "is held back"
    merging = drove.rows.get((row["time_s"], after))
    if merging is not None and merging["lane"] == "ramp":
        return f"makes room for {after}, which is to merge ahead of it"
    return "leaves room"


def _number(value: float | None) -> str:
    return "nothing" if value is None else f"{value:.2f}"


def _changes(row: Row) -> str:
    beside = (("behind", row["front_vehicle_id"]), ("ahead of", row["rear_vehicle_id"]))
    between = " and ".join(f"{word} {name}" for word, name in beside if name)
    where = (
        f"{between or 'where nobody is near'}, at station {row['station_m']:.1f} m and "
        f"{row['speed_mps']:.1f} m/s"
    )
    if row["lane"] == "ramp":
        return f"changes to the mainline {where}"
    after, told_mps2 = row["after_vehicle_id"], row["told_mps2"]
    whom = f"for {after}, which is to merge ahead of it" if after else "for who merges"
    spared = "" if told_mps2 is None else f", and need not slow down by {-told_mps2:.2f} m/s2"
    return f"makes way {whom}: changes to the lane further in {where}{spared}"


def gaps_asked(row: Row, drove: Drove) -> list[str]:
    """Returns the gaps beside a vehicle on the acceleration lane, against what a change asks."""
    lines: list[str] = []
    if row["law"] is None or row["lane"] != "ramp":
        return lines
    for side, word in SIDES.items():
        name = row[f"{side}_vehicle_id"]
        if name is None:
            continue
        asked_m, gap_m = drove.asked_m(row, side), row[f"{side}_gap_m"]
        kind = "automated" if drove.is_automated(name) else "a driver"
        asks = "no gap is enough" if math.isinf(asked_m) else f"a change asks for {asked_m:.1f} m"
        lines.append(
            f"gap to {name} {word} ({kind}, {row[f'{side}_speed_mps']:.1f} m/s): {gap_m:.1f} m; "
            f"{asks}"
        )
    return lines


def known_lines(
    run: RunRecords, drove: Drove, vehicle_ids: Sequence[str], time_s: float
) -> list[str]:
    """Returns what the coordinator knew of vehicles at a decision, and how old that was."""
    told = {name: _known(run, drove, name, time_s) for name in vehicle_ids}
    exact = [name for name, line in told.items() if not line]
    lines = [f"{name}: {line}" for name, line in told.items() if line]
    return [*lines, *([f"known exactly: {', '.join(exact)}"] if exact else [])]


def _known(run: RunRecords, drove: Drove, vehicle_id: str, time_s: float) -> str:
    """What was known of one vehicle, nothing where that was all."""
    if vehicle_id not in drove.reporting:
        return "a driver who is not connected; the coordinator does not know of him"
    row = None
    if run.heard is not None:
        found = run.heard.filter(pl.col("vehicle_id") == vehicle_id, pl.col("time_s") == time_s)
        row = None if found.is_empty() else found.row(0, named=True)
    if row is None:
        return ""
    if row["station_m"] is None:
        last = "never" if row["age_s"] is None else f"{row['age_s']:.1f} s ago"
        return f"not known to the coordinator; heard {last}"
    off_m = row["error_m"]
    side = "ahead of" if off_m > 0 else "behind"
    off = "where it was" if abs(off_m) < NEAR_M else f"{abs(off_m):.1f} m {side} where it was"
    heard = "heard now" if row["age_s"] < NOW_S else f"heard {row['age_s']:.1f} s ago"
    lost = ", its report lost" if row["report_lost"] else ""
    lost += ", its command lost" if row["command_lost"] else ""
    return f"{heard}, taken to be {off}{lost}"
