"""One vehicle's story in a run, from the files that the run left."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coramp.errors import CorampError
from coramp.explain.decision import EVEN_M, quantities
from coramp.explain.own_limits import own_quantities
from coramp.explain.quantity import Quantity
from coramp.records.run import RunRecords, moved_for
from coramp.records.run_folder import read_run
from coramp.records.schemas import Row


@dataclass(frozen=True)
class Chapter:
    """One decision about the vehicle, in a sentence, with the quantities behind it."""

    decision: Row
    text: str
    quantities: list[Quantity]


@dataclass(frozen=True)
class Story:
    """What happened to a vehicle: its passage, the decisions about it, those that moved it."""

    vehicle: Row
    chapters: list[Chapter]
    moved_for: list[Row]
    run: Row


def story_of(folder: Path, vehicle_id: str) -> Story:
    """Returns the story of a vehicle of a run, from its folder.

    Raises CorampError where there is no run, no such vehicle, or nothing was planned.
    """
    return story_in(read_run(folder), vehicle_id, folder)


def story_in(run: RunRecords, vehicle_id: str, folder: Path | None = None) -> Story:
    """Returns the story of a vehicle of a run that is at hand; errors name the ``folder``, if any.

    Raises CorampError where there is no such vehicle, or nothing was planned.
    """
    try:
        vehicle, decisions = run.vehicle(vehicle_id), run.coordinated("explain")[1]
    except CorampError as error:
        raise CorampError(f"{folder}: {error}" if folder is not None else str(error)) from None
    about = decisions.filter(vehicle_id=vehicle_id)
    return Story(
        vehicle,
        [
            Chapter(row, told(row, run.scenario.vehicles_differ), quantities_in(run, row))
            for row in about.iter_rows(named=True)
        ],
        moved_for(decisions, vehicle_id),
        {key: run.content[key] for key in ("scenario", "strategy", "seed", "run_id")},
    )


def quantities_in(run: RunRecords, decision: Row) -> list[Quantity]:
    """Returns the quantities behind a decision of a run: the paper's, or each vehicle's own."""
    if run.scenario.vehicles_differ:
        return own_quantities(decision, run)
    return quantities(decision, run.scenario)


def accelerates_evenly(decision: Row) -> bool:
    """Returns whether a merge has one acceleration from the nose on, as the paper's have."""
    t2_s = decision["merge_time_s"] - decision["nose_time_s"]
    even_m = decision["nose_speed_mps"] * t2_s + 0.5 * decision["accel_mps2"] * t2_s * t2_s
    return bool(abs(even_m - decision["merge_station_m"]) < EVEN_M)


def told(decision: dict[str, Any], vehicles_differ: bool = False) -> str:
    """Returns in one sentence what a decision was.

    Where vehicles differ, a merge need not have one acceleration from the nose on.
    """
    front, rear = decision["front_vehicle_id"], decision["rear_vehicle_id"]
    match front, rear:
        case None, None:
            where = "onto an empty mainline"
        case None, _:
            where = f"ahead of {rear}"
        case _, None:
            where = f"behind {front}"
        case _:
            where = f"between {front} and {rear}"
    moved = ", ".join(decision["adjusted_vehicle_ids"] or [])
    match decision["rung"]:
        case "free" | "reach" if not (vehicles_differ or accelerates_evenly(decision)):
            how = "a way of least effort leads into a gap: it merges"
        case "free":
            how = "free movement is safe as it is: it merges"
        case "reach":
            how = f"an acceleration of {decision['accel_mps2']:.3f} m/s2 reaches a gap: it merges"
        case "create":
            how = f"a gap is made (scenario {decision['scenario']}, moving {moved}): it merges"
        case "delay":
            how = "it slows down on the ramp for a later gap and merges"
            how += f" (braking behind it: {moved})" if moved else ""
        case _:
            return "no merge is safe yet: it keeps its stop before the nose and is planned again"
    return (
        f"{how} {where} at {decision['merge_time_s']:.2f} s, "
        f"station {decision['merge_station_m']:.1f} m"
    )
