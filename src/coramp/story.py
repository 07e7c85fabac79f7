"""One vehicle's story in a run, from the files that the run left."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coramp.errors import CorampError
from coramp.explanation import Quantity, quantities
from coramp.metrics.tables import Row
from coramp.run_folder import StoredRun, read_run
from coramp.scenario import Scenario


@dataclass(frozen=True)
class Chapter:
    """One decision about the vehicle, with the quantities behind it."""

    decision: Row
    quantities: list[Quantity]


@dataclass(frozen=True)
class Story:
    """What happened to a vehicle: its passage, the decisions about it, those that moved it."""

    vehicle: Row
    chapters: list[Chapter]
    moved_for: list[Row]
    run: Row


def story_of(folder: Path, vehicle_id: str) -> Story:
    """Returns the story of a vehicle of a run.

    Raises CorampError where there is no run, no such vehicle, or nothing was planned.
    """
    run = read_run(folder)
    found = run.vehicles.filter(vehicle_id=vehicle_id)
    if found.is_empty():
        known = sorted(run.vehicles["vehicle_id"].to_list())
        allowed = f"allowed are {known[0]} to {known[-1]}" if known else "nobody arrived"
        raise CorampError(f"{folder}: there is no vehicle {vehicle_id!r}; {allowed}")
    if run.decisions is None:
        raise CorampError(
            f"{folder}: nobody was coordinated in this run; explain a cooperative one"
        )
    decisions = run.decisions.filter(vehicle_id=vehicle_id)
    scenario = Scenario.model_validate(run.content["specification"], strict=False)
    return Story(
        found.row(0, named=True),
        [Chapter(row, quantities(row, scenario)) for row in decisions.iter_rows(named=True)],
        _moved_for(run, vehicle_id),
        {key: run.content[key] for key in ("scenario", "strategy", "seed", "run_id")},
    )


def _moved_for(run: StoredRun, vehicle_id: str) -> list[Row]:
    if run.decisions is None:
        return []
    return [
        row
        for row in run.decisions.iter_rows(named=True)
        if vehicle_id in (row["adjusted_vehicle_ids"] or [])
    ]


def told(decision: dict[str, Any]) -> str:
    """Returns in one sentence what a decision was."""
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
