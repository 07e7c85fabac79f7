"""Time stamps as seconds, and the hour that daylight saving takes or gives."""

from collections.abc import Sequence
from datetime import UTC, datetime, time, timedelta
from itertools import pairwise

from coramp.counts.table import Findings

FORMATS = ("%d.%m.%Y %H:%M", "%d.%m.%Y %H:%M:%S")
ALLOWED = "are seconds, or stamps like 2026-05-11 07:15 or 07:15:00, with or without +02:00"
HOUR = timedelta(hours=1)
HALF_A_DAY = timedelta(hours=12)
CHANGED_AT = (1, 2, 3)
"""On Sundays, clocks are changed at one of these hours."""
NO_DATE = datetime(1970, 1, 1).date()

Stream = tuple[str, int, str]


def stamp_of(word: str) -> datetime | None:
    """Returns the stamp that a word is, in UTC where it has an offset; None where it is none."""
    try:
        found = datetime.fromisoformat(word)
    except ValueError:
        return _other_stamp(word)
    return found if found.tzinfo is None else found.astimezone(UTC)


def _other_stamp(word: str) -> datetime | None:
    for form in FORMATS:
        try:
            return datetime.strptime(word, form)
        except ValueError:
            continue
    try:
        clock = time.fromisoformat(word)
    except ValueError:
        return None
    return datetime.combine(NO_DATE, clock)


def without_clock_changes(
    stamps: Sequence[datetime], streams: Sequence[Stream], rows: Sequence[int], findings: Findings
) -> list[datetime]:
    """Returns stamps that no change of clocks shifts, where it was asked to mend them.

    In autumn an hour comes twice, in spring one is missing. Stamps with an offset know no such
    thing.
    """
    kept = list(stamps)
    if not kept or kept[0].tzinfo is not None:
        return kept
    if kept[0].date() == NO_DATE:
        return _over_midnight(kept, streams, rows, findings)
    kept = _without_twice(kept, streams, rows, findings)
    return _without_missing(kept, rows, findings)


def _over_midnight(
    stamps: list[datetime], streams: Sequence[Stream], rows: Sequence[int], findings: Findings
) -> list[datetime]:
    """Times without a date, of the next day where they come behind midnight."""
    last: dict[Stream, datetime] = {}
    days: dict[Stream, timedelta] = {}
    kept = []
    for stamp, stream, row in zip(stamps, streams, rows, strict=True):
        before = last.get(stream, stamp)
        if before - stamp > HALF_A_DAY:
            what = f"time {stamp:%H:%M} comes after {before:%H:%M}, as behind midnight"
            allowed, mended = "are stamps with a date", "taken as of the next day"
            if not findings.tell_once("midnight", row, what, allowed, mended):
                return stamps
            days[stream] = days.get(stream, timedelta()) + timedelta(days=1)
        last[stream] = stamp
        kept.append(stamp + days.get(stream, timedelta()))
    return kept


def _without_twice(
    stamps: list[datetime], streams: Sequence[Stream], rows: Sequence[int], findings: Findings
) -> list[datetime]:
    """An hour of Sunday that comes twice for every stream that has it."""
    seen: dict[tuple[Stream, datetime], int] = {}
    second = []
    for stream, stamp in zip(streams, stamps, strict=True):
        seen[stream, stamp] = seen.get((stream, stamp), 0) + 1
        second.append(seen[stream, stamp] == 2)
    hours = {_hour(s) for s, again in zip(stamps, second, strict=True) if again}
    if len(hours) != 1 or max(seen.values()) > 2:
        return stamps
    (hour,) = hours
    here = [times for (_, stamp), times in seen.items() if _hour(stamp) == hour]
    if not _may_change(hour) or set(here) != {2}:
        return stamps
    first = min(row for row, again in zip(rows, second, strict=True) if again)
    what = f"the hour from {hour:%Y-%m-%d %H:%M} comes twice, as where daylight saving ends"
    if not findings.tell(first, what, "are stamps with an offset, like +02:00", "told apart"):
        return stamps
    return [
        stamp + HOUR if again or stamp >= hour + HOUR else stamp
        for stamp, again in zip(stamps, second, strict=True)
    ]


def _without_missing(
    stamps: list[datetime], rows: Sequence[int], findings: Findings
) -> list[datetime]:
    """An hour of Sunday that no stream has, between two that it has."""
    ordered = sorted(set(stamps))
    usual = min((b - a for a, b in pairwise(ordered)), default=HOUR)
    for before, after in pairwise(ordered):
        missing = before + usual
        if after - missing == HOUR and missing == _hour(missing) and _may_change(missing):
            first = min(row for row, stamp in zip(rows, stamps, strict=True) if stamp == after)
            what = f"there is no hour from {missing:%Y-%m-%d %H:%M}"
            what += ", as where daylight saving begins"
            allowed = "are stamps with an offset, like +02:00"
            if findings.tell(first, what, allowed, "later rows are an hour earlier"):
                return [stamp - HOUR if stamp >= after else stamp for stamp in stamps]
    return stamps


def _hour(stamp: datetime) -> datetime:
    return stamp.replace(minute=0, second=0, microsecond=0)


def _may_change(hour: datetime) -> bool:
    return hour.weekday() == 6 and hour.hour in CHANGED_AT
