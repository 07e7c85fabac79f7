"""Intervals that a file of counts leaves out, and what stands in for them."""

import math
from itertools import pairwise

from coramp.counts.table import Findings, Line

SAME_S = 1e-6
LONGEST_GAP_S = 3600.0
"""A longer gap is not filled in."""

Stream = tuple[str, int, str]


def without_gaps(lines: list[Line], findings: Findings) -> list[Line]:
    """Returns lines that have each interval of the file for each place and class.

    A place where an interval has no row at all has a gap: it is told, or mended by what lies
    between the counts before and behind. A class that an interval lacks while others are there is
    one that nobody was seen of: its count is 0. So is one that is written down but not known.
    """
    intervals = sorted({(line.begin_s, line.end_s) for line in lines})
    intervals = _longest_each(intervals)
    if not _one_after_another(intervals, lines, findings):
        return [line for line in lines if not math.isnan(line.vehicles)]
    places: dict[tuple[str, int], dict[float, list[Line]]] = {}
    for line in lines:
        places.setdefault(line.place, {}).setdefault(line.begin_s, []).append(line)
    filled: list[Line] = []
    for here in places.values():
        filled += _filled(here, intervals, findings)
    return sorted(filled, key=lambda line: (line.begin_s, line.stream, line.row))


def _longest_each(intervals: list[tuple[float, float]]) -> list[tuple[float, float]]:
    return sorted({begin: (begin, end) for begin, end in intervals}.values())


def _one_after_another(
    intervals: list[tuple[float, float]], lines: list[Line], findings: Findings
) -> bool:
    """Whether intervals follow on each other; tells where none of the file's places has a row."""
    steps = [end - begin for begin, end in intervals[:-1]]
    if any(abs(step - steps[0]) > SAME_S for step in steps):
        odd = next(k for k, step in enumerate(steps) if abs(step - steps[0]) > SAME_S)
        row = min(line.row for line in lines if line.begin_s == intervals[odd][0])
        what = f"an interval of {steps[odd]:g} s in a file with {steps[0]:g} s"
        findings.tell(row, what, "is one length in a file, the last interval may be shorter")
        return False
    missing: list[tuple[float, float]] = []
    for (_, end), (begin, _) in pairwise(intervals):
        length_s = steps[0]
        if begin < end - SAME_S:
            return False  # told of each stream
        count = round((begin - end) / length_s)
        if abs(begin - end - count * length_s) > SAME_S:
            row = min(line.row for line in lines if line.begin_s == begin)
            what = f"begins at {begin:g} s, which is no multiple of {length_s:g} s after {end:g} s"
            findings.tell(row, what, "are intervals that follow on each other")
            return False
        missing += [(end + k * length_s, end + (k + 1) * length_s) for k in range(count)]
    intervals += missing
    intervals.sort()
    return True


def _filled(
    here: dict[float, list[Line]], intervals: list[tuple[float, float]], findings: Findings
) -> list[Line]:
    """The lines of one place, one for each interval and class."""
    classes = sorted({line.vehicle_class for found in here.values() for line in found})
    filled: list[Line] = []
    unknown: set[tuple[str, float]] = set()
    last = min((line for found in here.values() for line in found), key=lambda line: line.row)
    gap_from_s = None
    for begin_s, end_s in intervals:
        found = {line.vehicle_class: line for line in here.get(begin_s, ())}
        if not found:
            gap_from_s = begin_s if gap_from_s is None else gap_from_s
        elif gap_from_s is not None:
            _tell_gap(last, gap_from_s, begin_s, findings)
            gap_from_s = None
        for kind in classes:
            line = found.get(kind)
            if line is None:
                row = last.row
                line = Line(row, begin_s, end_s, last.detector, last.lane, kind, 0.0, None)
                if not found:
                    unknown.add((kind, begin_s))
            elif math.isnan(line.vehicles):
                unknown.add((kind, begin_s))
            filled.append(line)
        last = max(found.values(), key=lambda line: line.row) if found else last
    if gap_from_s is not None:
        _tell_gap(last, gap_from_s, intervals[-1][1], findings)
    return _between(filled, unknown)


def _tell_gap(last: Line, from_s: float, to_s: float, findings: Findings) -> None:
    what = f"{last.where} has no row from {from_s:g} to {to_s:g} s"
    mended = "filled in from the counts before and behind"
    short = to_s - from_s <= LONGEST_GAP_S
    findings.tell(last.row, what, "are files without gaps", mended if short else "")


def _between(lines: list[Line], unknown: set[tuple[str, float]]) -> list[Line]:
    """The lines with counts that are not known evenly between those that are."""
    result = []
    for kind in sorted({line.vehicle_class for line in lines}):
        own = [line for line in lines if line.vehicle_class == kind]
        known = [k for k, line in enumerate(own) if (kind, line.begin_s) not in unknown]
        for k, line in enumerate(own):
            if (kind, line.begin_s) not in unknown:
                result.append(line)
                continue
            before = max((j for j in known if j < k), default=None)
            behind = min((j for j in known if j > k), default=None)
            result.append(line._replace(vehicles=_weighed(own, before, k, behind)))
    return result


def _weighed(lines: list[Line], before: int | None, place: int, behind: int | None) -> float:
    """A whole number on the line between two counts; the one there is where one is missing."""

    def rate(k: int) -> float:
        return lines[k].vehicles / (lines[k].end_s - lines[k].begin_s)

    if before is None and behind is None:
        return 0.0
    if before is None or behind is None:
        known = before if before is not None else behind
        rate_ps = rate(known)  # type: ignore[arg-type]
    else:
        share = (place - before) / (behind - before)
        rate_ps = (1.0 - share) * rate(before) + share * rate(behind)
    return float(round(rate_ps * (lines[place].end_s - lines[place].begin_s)))
