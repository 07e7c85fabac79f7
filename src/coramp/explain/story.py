"""One vehicle's story in a run, from the files that the run left."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coramp.errors import CorampError
from coramp.explain.case import evenly
from coramp.explain.decision import quantities
from coramp.explain.own_limits import own_quantities
from coramp.explain.quantity import Quantity
from coramp.explain.words import NOT_KEPT, NOT_TOLD, reason_in_words, tried_lines, where
from coramp.records.run import RunRecords, moved_for
from coramp.records.run_folder import read_run
from coramp.records.schemas import Row


@dataclass(frozen=True)
class Chapter:
    """One decision about the vehicle: in a sentence, what was tried for it, and its quantities.

    ``tried`` is one line an attempt, or one line that says why there are none.
    """

    decision: Row
    text: str
    tried: list[str]
    quantities: list[Quantity]


@dataclass(frozen=True)
class RefusedPlan:
    """A plan that the checker refused: when, in a sentence, and what had been tried for it."""

    time_s: float
    text: str
    tried: list[str]


@dataclass(frozen=True)
class Story:
    """What happened to a vehicle: its passage, the decisions about it, those that moved it.

    ``refused`` are the plans for it that the checker refused.
    """

    vehicle: Row
    chapters: list[Chapter]
    refused: list[RefusedPlan]
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
    about = decisions.filter(vehicle_id=vehicle_id).rows(named=True)
    return Story(
        vehicle,
        [chapter_in(run, row) for row in about],
        refused_plans(run, vehicle_id),
        moved_for(decisions, vehicle_id),
        {key: run.content[key] for key in ("scenario", "strategy", "seed", "run_id")},
    )


def chapter_in(run: RunRecords, decision: Row) -> Chapter:
    """Returns one decision of a run with what its records tell of it."""
    return Chapter(
        decision,
        told(decision, run.scenario.vehicles_differ),
        tried_in(run, decision),
        quantities_in(run, decision),
    )


def attempts_for(run: RunRecords, decision: Row) -> list[Row]:
    """Returns the attempts of a decision, in order; none where none were kept."""
    return run.attempts_of.get((decision["vehicle_id"], decision["time_s"]), [])


def tried_in(run: RunRecords, decision: Row) -> list[str]:
    """Returns what was tried for a decision of a run, line by line."""
    if run.attempts is None:
        return [NOT_KEPT]
    return tried_lines(attempts_for(run, decision)) or [NOT_TOLD]


def refused_plans(run: RunRecords, vehicle_id: str) -> list[RefusedPlan]:
    """Returns the plans for a vehicle of a run that the checker refused, in order of time."""
    found = []
    for (name, time_s), attempts in run.attempts_of.items():
        if name == vehicle_id and attempts[-1]["checker_reason"] is not None:
            text = reason_in_words(attempts[-1])
            found.append(RefusedPlan(time_s, text, tried_lines(attempts)))
    return found


def quantities_in(run: RunRecords, decision: Row) -> list[Quantity]:
    """Returns the quantities behind a decision of a run: the paper's, or each vehicle's own."""
    if run.scenario.vehicles_differ:
        return own_quantities(decision, run)
    return quantities(decision, attempts_for(run, decision), run.scenario.rules())


def accelerates_evenly(decision: Row) -> bool:
    """Returns whether a merge has one acceleration from the nose on, as the paper's have."""
    t2_s = decision["merge_time_s"] - decision["nose_time_s"]
    nose_mps, accel_mps2 = decision["nose_speed_mps"], decision["accel_mps2"]
    return evenly(nose_mps, accel_mps2, t2_s, decision["merge_station_m"])


def told(decision: dict[str, Any], vehicles_differ: bool = False) -> str:
    """Returns in one sentence what a decision was.

    Where vehicles differ, a merge need not have one acceleration from the nose on.
    """
    place = where(decision["front_vehicle_id"], decision["rear_vehicle_id"])
    moved = ", ".join(decision["adjusted_vehicle_ids"] or [])
    match decision["rung"]:
        case "free" | "reach" if not (vehicles_differ or accelerates_evenly(decision)):
            how = "a way of least effort leads into a gap: it merges"
        case "free":
            how = "free movement is safe as it is: it merges"
        case "reach":
            how = f"an acceleration of {decision['accel_mps2']:.3f} m/s2 reaches a gap: it merges"
        case "make way":
            how = f"{moved} makes way to the lane further in: it merges"
        case "create":
            how = f"a gap is made (scenario {decision['scenario']}, moving {moved}): it merges"
        case "delay":
            how = "it slows down on the ramp for a later gap and merges"
            how += f" (braking behind it: {moved})" if moved else ""
        case _:
            return "no merge is safe yet: it keeps its stop before the nose and is planned again"
    return (
        f"{how} {place} at {decision['merge_time_s']:.2f} s, "
        f"station {decision['merge_station_m']:.1f} m"
    )
