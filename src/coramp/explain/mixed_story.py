"""One vehicle's story in a run of mixed traffic: what it did at each decision, and why."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import polars as pl

from coramp.errors import CorampError
from coramp.explain.mixed_gaps import Drove
from coramp.explain.mixed_words import TOLD, assumed, done, gaps_asked, known_lines
from coramp.records.lapses import UNKNOWN, lapses_in, period_s
from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.strategies.registry import strategy_named

SHORTEST_S = 0.7
"""What lasts less is told with what came before it, but for lane changes and fallbacks."""


@dataclass(frozen=True)
class MixedChapter:
    """What a vehicle did from ``from_s`` until ``until_s``, and what was known when it began.

    ``gaps`` are those beside it on the acceleration lane, against what a lane change asks for.
    """

    from_s: float
    until_s: float
    text: str
    known: list[str]
    gaps: list[str]


@dataclass(frozen=True)
class MixedStory:
    """What happened to a vehicle of mixed traffic; ``assumed`` is what the laws reckon with."""

    vehicle: Row
    assumed: list[str]
    chapters: list[MixedChapter]
    run: Row


def is_told_apart(run: RunRecords) -> bool:
    """Returns whether a run is of automated vehicles that were coordinated among drivers."""
    return run.safety_events is not None and strategy_named(run.content["strategy"]).cooperative


def mixed_story_in(run: RunRecords, vehicle_id: str, folder: Path | None = None) -> MixedStory:
    """Returns the story of a vehicle; errors name the ``folder``, if any.

    Raises CorampError where there is no such vehicle, or what was done was not kept.
    """
    where = f"{folder}: " if folder is not None else ""
    try:
        vehicle = run.vehicle(vehicle_id)
    except CorampError as error:
        raise CorampError(f"{where}{error}") from None
    if run.on_board is None:
        raise CorampError(
            f"{where}vehicles among drivers drive without plans, and what they did on board was "
            "not kept; run again with --keep-messages"
        )
    drove = Drove(run)
    chapters = [*_chapters(run, run.on_board, drove, vehicle_id), *_events(run, vehicle_id)]
    chapters.sort(key=lambda chapter: chapter.from_s)
    told = {key: run.content[key] for key in ("scenario", "strategy", "seed", "run_id")}
    return MixedStory(vehicle, assumed(drove), chapters, told)


def acts_of(run: RunRecords) -> dict[str, list[tuple[float, float, str]]] | None:
    """Returns what each vehicle did from when to when (s), None where that was not kept."""
    if run.on_board is None:
        return None
    drove, step_s = Drove(run), period_s(run.on_board)
    of_each = run.on_board.sort("vehicle_id", "time_s").partition_by("vehicle_id")
    return {
        own["vehicle_id"][0]: [
            (block[0]["time_s"], round(block[-1]["time_s"] + step_s, 3), done(block[0], drove))
            for block in _blocks(own.rows(named=True), step_s)
        ]
        for own in of_each
    }


def _chapters(
    run: RunRecords, on_board: pl.DataFrame, drove: Drove, vehicle_id: str
) -> list[MixedChapter]:
    rows = on_board.filter(vehicle_id=vehicle_id).sort("time_s").rows(named=True)
    step_s = period_s(on_board)
    return [_chapter(run, drove, block, step_s) for block in _blocks(rows, step_s)]


def _blocks(rows: Sequence[Row], step_s: float) -> list[list[Row]]:
    """The decisions of a vehicle, those together that are alike to tell."""
    return _joined([list(group) for _, group in groupby(rows, key=_key)], step_s)


def _key(row: Row) -> tuple[object, ...]:
    """What makes two decisions different to tell."""
    whom = row["after_vehicle_id"] if row["law"] == TOLD or row["lane"] == "ramp" else None
    leader = row["leader_vehicle_id"] if row["law"] not in (None, TOLD) else None
    return row["lane"], row["law"], whom, leader, row["fallback"], row["changes_lane"]


def _joined(blocks: Sequence[list[Row]], step_s: float) -> list[list[Row]]:
    """Blocks of decisions that are alike; short ones are joined to the one before."""
    joined: list[list[Row]] = []
    for block in blocks:
        last = joined[-1] if joined else None
        short = len(block) * step_s < SHORTEST_S
        if last is not None and (_key(last[0]) == _key(block[0]) or (short and _like(last, block))):
            last.extend(block)
        else:
            joined.append(list(block))
    return joined


def _like(last: Sequence[Row], block: Sequence[Row]) -> bool:
    """Whether two blocks do not differ in what is told however short it is."""
    return all(last[0][name] == block[0][name] for name in ("changes_lane", "fallback"))


def _chapter(run: RunRecords, drove: Drove, block: Sequence[Row], step_s: float) -> MixedChapter:
    first = block[0]
    beside = first["lane"] == "ramp" or first["changes_lane"]
    others = ("after", "front", "rear") if beside else ("after",)
    names = [first["vehicle_id"], *(first[f"{other}_vehicle_id"] for other in others)]
    told = [name for name in dict.fromkeys(names) if name is not None]
    return MixedChapter(
        first["time_s"],
        block[-1]["time_s"] + step_s,
        done(first, drove),
        known_lines(run, drove, told, first["time_s"]),
        gaps_asked(first, drove),
    )


def _events(run: RunRecords, vehicle_id: str) -> list[MixedChapter]:
    """When nobody knew of it, and what happened to it by itself."""
    found = [
        MixedChapter(lapse.from_s, lapse.until_s, "not known to the coordinator", [], [])
        for lapse in lapses_in(run.heard)
        if lapse.vehicle_id == vehicle_id and lapse.what == UNKNOWN
    ]
    if run.safety_events is not None:
        events = run.safety_events.filter(rear_vehicle_id=vehicle_id)
        found += [
            MixedChapter(row["time_s"], row["time_s"], _event(row), [], [])
            for row in events.iter_rows(named=True)
        ]
    return found


def _event(row: Row) -> str:
    front = row["front_vehicle_id"]
    return f"{row['event']}, {front} ahead of it" if front else str(row["event"])
