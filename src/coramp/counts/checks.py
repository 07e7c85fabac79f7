"""What does not add up in counts, told by row, and how each is mended where that is asked for."""

import math
from collections.abc import Callable, Iterable, Sequence
from statistics import median

from coramp.counts.gaps import without_gaps
from coramp.counts.table import LONGEST_S, SHORTEST_S, Findings, Line

CAPACITY_VEH_H = 2600.0
"""More than so many vehicles an hour no lane carries."""
PLATOON_VEH_H, PLATOON_S = 3600.0, 300.0
"""Within less than 5 min a lane may carry more: platoons at headways of 1 s."""
MOST_LANES = 6
"""So many lanes a detector may have whose counts name none."""
FASTEST_MPS = 55.0
"""No interval has a higher mean speed: 198 km/h."""
KMH = 3.6
HOUR_S = 3600.0
SAME_S = 1e-6

Check = Callable[[list[Line], Findings], list[Line]]


def that_add_up(lines: list[Line], findings: Findings, lanes: int | None = None) -> list[Line]:
    """Returns lines that add up, sorted, after telling what does not, or mending it.

    ``lanes`` is how many lanes a detector has whose counts name none.
    """
    rows_are_missing = bool(findings.problems)  # a gap would only follow from what is told already
    checks: tuple[Check, ...] = (
        _whole_intervals,
        _once,
        _numbers_of_vehicles,
        _speeds,
        *(() if rows_are_missing else (without_gaps,)),
        lambda found, told: _capacity(found, told, lanes),
    )
    lines = sorted(lines, key=lambda line: (line.begin_s, line.stream, line.row))
    for check in checks:
        lines = check(lines, findings)
    return lines


def _whole_intervals(lines: list[Line], findings: Findings) -> list[Line]:
    """Intervals of 1 to 60 min, only the last of all shorter, and none that overlap."""
    kept = []
    last_s = max((line.begin_s for line in lines), default=0.0)
    for line in lines:
        length_s = line.end_s - line.begin_s
        least_s = SAME_S if line.begin_s == last_s else SHORTEST_S - SAME_S
        if line.begin_s < -SAME_S:
            findings.tell(line.row, f"begins at {line.begin_s:g} s", "is 0 s or later")
        elif not least_s <= length_s <= LONGEST_S + SAME_S:
            what = f"the interval from {line.begin_s:g} to {line.end_s:g} s is {length_s:g} s long"
            findings.tell(line.row, what, f"are {SHORTEST_S:g} to {LONGEST_S:g} s")
        else:
            kept.append(line)
    return _apart(kept, findings)


def _apart(lines: list[Line], findings: Findings) -> list[Line]:
    before: dict[tuple[str, int, str], Line] = {}
    for line in lines:
        last = before.get(line.stream)
        if last is not None and last.begin_s < line.begin_s < last.end_s - SAME_S:
            what = f"begins at {line.begin_s:g} s, within the interval of row {last.row}"
            findings.tell(line.row, what, f"is {last.end_s:g} s or later")
        before[line.stream] = line
    return lines


def _once(lines: list[Line], findings: Findings) -> list[Line]:
    """No interval twice; the same row again can be left out, another count cannot."""
    first: dict[tuple[float, tuple[str, int, str]], Line] = {}
    kept = []
    for line in lines:
        key = (line.begin_s, line.stream)
        same = first.setdefault(key, line)
        if same is line:
            kept.append(line)
            continue
        alike = same[1:] == line[1:]
        what = f"{line.where}, {line.vehicle_class} at {line.begin_s:g} s is there already, "
        what += f"in row {same.row}" + ("" if alike else " with other values")
        findings.tell(line.row, what, "is once", "left out" if alike else "")
    return kept


def _numbers_of_vehicles(lines: list[Line], findings: Findings) -> list[Line]:
    """Whole numbers from 0 on. Fractions are mended so that sums stay, by stream."""
    carried: dict[tuple[str, int, str], float] = {}
    kept = []
    for line in lines:
        vehicles = line.vehicles
        if vehicles < 0.0:
            what = f"{vehicles:g} vehicles"
            findings.tell(line.row, what, "are whole numbers from 0 on", "taken as not counted")
            vehicles = math.nan
        elif not math.isnan(vehicles) and vehicles != math.floor(vehicles):
            exact = vehicles + carried.get(line.stream, 0.0)
            whole = max(0, round(exact))
            mended = f"taken as {whole}"
            findings.tell(line.row, f"{vehicles:g} vehicles", "are whole numbers", mended)
            carried[line.stream] = exact - whole
            vehicles = float(whole)
        kept.append(line._replace(vehicles=vehicles))
    return kept


def _speeds(lines: list[Line], findings: Findings) -> list[Line]:
    """Speeds in m/s that vehicles can have; a file in km/h is mended as a whole."""
    told = [line.mean_speed_mps for line in lines if line.mean_speed_mps is not None]
    fast = [line for line in lines if (line.mean_speed_mps or 0.0) > FASTEST_MPS]
    in_kmh = bool(fast) and median(told) > FASTEST_MPS / 2.0
    allowed = f"is up to {FASTEST_MPS:g} m/s; speeds in km/h belong into mean_speed_kmh"
    mended = False
    for line in fast:
        speed = line.mean_speed_mps or 0.0
        what = f"a mean speed of {speed:g} m/s"
        how = f"all speeds of the file taken as km/h, here {speed / KMH:.4g} m/s"
        mended = findings.tell(line.row, what, allowed, how if in_kmh else "")
        if in_kmh:
            break  # told once: it holds for the file
    kept = []
    for line in lines:
        told_mps = line.mean_speed_mps
        if told_mps is not None and mended:
            told_mps /= KMH
        if told_mps is not None and told_mps < 0.0:
            what = f"a mean speed of {told_mps:g} m/s"
            findings.tell(line.row, what, "is 0 or more", "taken as not measured")
            told_mps = None
        kept.append(line._replace(mean_speed_mps=told_mps))
    return kept


def _capacity(lines: list[Line], findings: Findings, lanes: int | None) -> list[Line]:
    """No more vehicles of all classes in an interval than its lanes carry."""
    by_interval: dict[tuple[float, tuple[str, int]], list[Line]] = {}
    for line in lines:
        if not math.isnan(line.vehicles):
            by_interval.setdefault((line.begin_s, line.place), []).append(line)
    for here in by_interval.values():
        first = here[0]
        length_s = first.end_s - first.begin_s
        count = sum(line.vehicles for line in here)
        many = 1 if first.lane is not None else lanes or MOST_LANES
        most_veh_h = many * (PLATOON_VEH_H if length_s < PLATOON_S - SAME_S else CAPACITY_VEH_H)
        if count * HOUR_S <= most_veh_h * max(length_s, SHORTEST_S):
            continue
        row = max(here, key=lambda line: line.vehicles).row
        per = "a lane" if many == 1 else f"on {many} lanes"
        what = f"{count:g} vehicles in {length_s:g} s are {count * HOUR_S / length_s:g} veh/h"
        allowed = f"are up to {most_veh_h:g} veh/h {per}"
        allowed += "; counts per hour belong into flow_veh_h" if _per_hour(here, many) else ""
        findings.tell(row, what, allowed)
    return lines


def _per_hour(here: Sequence[Line], lanes: int) -> bool:
    return sum(line.vehicles for line in here) <= lanes * CAPACITY_VEH_H


def check_balance(
    lines: Iterable[Line],
    upstream: Sequence[str],
    downstream: str,
    findings: Findings,
    room: float,
) -> list[Line]:
    """Returns lines of which as many leave as came, but for ``room`` vehicles on the way.

    Up to each interval's end, the detectors ``upstream`` have counted so many that the one
    ``downstream`` has not. Mended is what is downstream: it is given those that it lacks.
    """
    lines = list(lines)
    times = sorted({line.begin_s for line in lines})
    balance = 0.0
    extra: dict[int, float] = {}
    for begin_s in times:
        now = [(k, line) for k, line in enumerate(lines) if line.begin_s == begin_s]
        came = sum(line.vehicles for _, line in now if line.detector in upstream)
        there = [(k, line) for k, line in now if line.detector == downstream]
        balance += came - sum(line.vehicles for _, line in there)
        if balance > room and there:
            k, line = max(there, key=lambda found: found[1].vehicles)
            what = f"up to {line.end_s:g} s {downstream} has {balance:g} vehicles less than "
            what += f"{' and '.join(upstream)} upstream of it"
            allowed = f"are up to {room:g} on the way"
            if findings.tell(line.row, what, allowed, f"{balance:g} added here"):
                extra[k] = balance
            balance = 0.0
    return [
        line._replace(vehicles=line.vehicles + extra.get(k, 0.0)) for k, line in enumerate(lines)
    ]
