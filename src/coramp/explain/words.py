"""What was tried for a decision, in plain English."""

from collections import Counter
from collections.abc import Sequence
from itertools import groupby

from coramp.metrics.attempts import REFUSED_BY_CHECKER
from coramp.records.schemas import Row
from coramp.strategies import attempts as a
from coramp.vehicles import trace as t

TOLD_SINGLY = 3
"""So many attempts of one kind have their lines; the others have one for each reason."""
NOT_KEPT = "what was tried was not kept: an older coramp wrote this run; run it again"
NOT_TOLD = "the strategy does not tell what it tried"

_WAYS = {
    ("free", 0): "free movement",
    ("reach", 0): "another acceleration",
    ("make way", 0): "the vehicle in conflict makes way",
    ("create", 0): "a gap made",
    ("create", 1): "X moves ahead",
    ("create", 2): "Y falls back",
    ("create", 3): "X and Y move",
    ("delay", 0): "come later",
    ("delay", 2): "come later, Y falls back",
}
_BY_AMOUNT = {
    a.REASONS[t.AHEAD_OF_REACH]: "the gap lies {} ahead of what it can reach",
    a.REASONS[t.BEHIND_REACH]: "the gap lies {} behind what it can reach",
    a.REASONS[t.HOLDS_UP_NEWCOMER]: "it would be {} too far back for a mainline vehicle that is "
    "yet to enter",
    a.REASONS[t.FRONT_OUT_OF_REACH]: "the front of the gap lies {} ahead of what it can reach",
    a.REASONS[t.PAST_LAST_STATION]: "it would merge {} past the last merge station",
    a.REASONS[t.BEFORE_THE_NOSE]: "it would merge {} before the nose",
    a.REASONS[t.TOO_LATE]: "the slot is {} too far back; an earlier one is waited for",
}
"""Reasons that read better with the distance inside."""
_BY_VEHICLE = {
    a.REASONS[t.SHIFT_TOO_FAR]: "{} cannot move so far within its bounds of speed and acceleration",
    a.REASONS[t.SHIFT_TOO_FAST]: "{} would leave the bounds of speed as it moves aside",
    a.REASONS[t.SHIFT_TOO_HARD]: "{} would leave the bounds of acceleration as it moves aside",
    a.REASONS[t.TOO_MANY_MOVE]: "{} would have to move too, and that is more than may change",
    a.REASONS[t.FOLLOWERS_CANNOT_BRAKE]: "{} behind it on the ramp cannot brake for it",
    a.REASONS[t.CANNOT_FALL_BACK]: "{} cannot fall back for it",
    a.REASONS[t.CANNOT_FOLLOW]: "it cannot follow {} at a safe distance",
    a.REASONS[t.LEAVES_LANE]: "{} is changing lanes already",
    a.REASONS[t.NOT_ON_MAINLINE]: "{} is still on the ramp",
    a.REASONS[t.NO_GAP_FURTHER_IN]: "{} cannot move to a gap further in",
    a.REASONS[t.CHANGE_TOO_LATE]: "{} could not change lanes before it reaches the nose",
}
"""Reasons that name the vehicle which cannot do its part."""
_TOO_NEAR = a.REASONS[t.TOO_NEAR]


def where(front: str | None, rear: str | None) -> str:
    """Returns between whom a merge is."""
    match front, rear:
        case None, None:
            return "onto an empty mainline"
        case None, _:
            return f"ahead of {rear}"
        case _, None:
            return f"behind {front}"
        case _:
            return f"between {front} and {rear}"


def tried_lines(attempts: Sequence[Row]) -> list[str]:
    """Returns what was tried, in order: one line an attempt.

    Of many attempts of one kind the first have their lines; the others have one line together for
    each reason why they failed, with how many and by how much. The one chosen has its own.
    """
    lines: list[str] = []
    for _, group in groupby(attempts, key=_way):
        block = list(group)
        further = block[TOLD_SINGLY:]
        reasons = Counter(row["reason"] for row in further)
        singly = [row for row in further if reasons[row["reason"]] == 1]
        lines += map(_line, block[:TOLD_SINGLY])
        lines += [
            _further([row for row in further if row["reason"] == reason])
            for reason, count in reasons.items()
            if count > 1
        ]
        lines += map(_line, singly)
    return lines


def _way(row: Row) -> str:
    return _WAYS.get((row["rung"], row["scenario"] or 0), str(row["rung"]))


def _line(row: Row) -> str:
    front, rear = row["front_vehicle_id"], row["rear_vehicle_id"]
    nowhere = row["merge_time_s"] is None and front is None and rear is None
    place = "" if nowhere else f" {where(front, rear)}"
    way, moved = _way(row), row["moved_vehicle_id"]
    if row["rung"] == "make way" and moved is not None:
        way = f"{moved} makes way"
    if row["rung"] == "reach" and row["accel_mps2"] is not None:
        way = f"an acceleration of {row['accel_mps2']:.3f} m/s2"
    return f"{row['attempt']}. {way}{place}: {reason_in_words(row)}"


def reason_in_words(row: Row) -> str:
    """Returns why an attempt was refused, with vehicles and distances; or where it merges."""
    reason, missing_m = row["reason"], row["missing_m"]
    other, moved = row["other_vehicle_id"], row["moved_vehicle_id"]
    by = "" if missing_m is None else f" by {_metres(missing_m)}"
    if reason == a.CHOSEN:
        return f"chosen{_merge(row)}"
    if reason == REFUSED_BY_CHECKER:
        of_whom = "" if other is None else f" ({other}{by})"
        return f"{reason}: {row['checker_reason']}{of_whom}"
    if reason == _TOO_NEAR:
        where_to = " further in" if row["rung"] == "make way" and moved else ""
        return f"{moved or 'it'} would come too near to {other}{where_to}{by}"
    if reason in _BY_AMOUNT and missing_m is not None:
        return _BY_AMOUNT[reason].format(_metres(missing_m))
    if reason in _BY_VEHICLE and other is not None:
        too_far = "" if missing_m is None else f", {_metres(missing_m)} too far"
        return _BY_VEHICLE[reason].format(other) + too_far
    return f"{reason}{by}"


def _merge(row: Row) -> str:
    if row["merge_time_s"] is None:
        return ""
    return f", merge at {row['merge_time_s']:.2f} s, station {row['merge_station_m']:.1f} m"


def _further(rows: Sequence[Row]) -> str:
    """Tells attempts that fail for one reason together, with the range of what is missing."""
    missing_m = [row["missing_m"] for row in rows if row["missing_m"] is not None]
    by = ""
    if missing_m:
        by = f", by {min(missing_m):.2f} to {_metres(max(missing_m))}"
    gaps = {(row["front_vehicle_id"], row["rear_vehicle_id"]) for row in rows}
    what = f"{len(gaps)} further gaps" if len(gaps) == len(rows) else f"{len(rows)} further times"
    numbers = _ranges([row["attempt"] for row in rows])
    return f"{numbers}. {_way(rows[0])}, {what}: {rows[0]['reason']}{by}"


def _ranges(numbers: Sequence[int]) -> str:
    """Returns ascending numbers in words: ``5 to 9, 11``."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][-1] + 1:
            parts[-1].append(number)
        else:
            parts.append([number])
    return ", ".join(f"{p[0]} to {p[-1]}" if len(p) > 1 else str(p[0]) for p in parts)


def _metres(missing_m: float) -> str:
    """Returns a distance with two digits, or as many as show that it is more than nothing."""
    return f"{missing_m:.2f} m" if missing_m >= 0.005 else f"{missing_m:.1e} m"
