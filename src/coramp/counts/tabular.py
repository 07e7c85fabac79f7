"""Lines of counts from a table with named columns: CSV, Parquet, and dfrouter's CSV."""

import difflib
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime
from itertools import pairwise

from coramp.counts.stamps import ALLOWED as TIMES_ALLOWED
from coramp.counts.stamps import stamp_of, without_clock_changes
from coramp.counts.table import CAR, TRUCK, Findings, Line
from coramp.counts.text import Words
from coramp.errors import CorampError

BEGIN, END, DETECTOR, LANE, CLASS = "begin_s", "end_s", "detector", "lane", "class"
VEHICLES, PER_HOUR = "vehicles", "flow_veh_h"
SPEED_MPS, SPEED_KMH = "mean_speed_mps", "mean_speed_kmh"
ALSO = {
    "time": BEGIN,
    "begin": BEGIN,
    "end": END,
    "edge": DETECTOR,
    "vehicle_class": CLASS,
}
"""Other names of columns."""
COLUMNS = (BEGIN, END, DETECTOR, LANE, CLASS, VEHICLES, PER_HOUR, SPEED_MPS, SPEED_KMH)
NAMES = "are the columns time or begin_s, end_s, detector or edge, lane, class, vehicles or "
NAMES += "flow_veh_h, mean_speed_mps or mean_speed_kmh"
DFROUTER = ("detector", "time", "qpkw")
MOST_LANE = 9
COUNTED = ("vehicles", "flow_veh_h", "qpkw", "qlkw")
WHOLE = ("vehicles", "qpkw", "qlkw")
THOUSANDS = (
    re.compile(r"\d{1,3}(?:\.\d{3})+(?P<rest>,\d+)"),
    re.compile(r"\d{1,3}(?:,\d{3})+(?P<rest>\.\d+)"),
    re.compile(r"\d{1,3}(?:\.\d{3}){2,}(?P<rest>)"),
    re.compile(r"\d{1,3}(?:,\d{3}){2,}(?P<rest>)"),
    re.compile(r"\d{1,3}(?:['\u2019\s]\d{3})+(?P<rest>(?:[.,]\d+)?)"),
)
"""Numbers as spreadsheets show them: 1.234,5 or 1,234.5 or 1'234 or 1 234."""
TWO_MEANINGS = re.compile(r"\d{1,3}[.,]\d{3}")
"""A thousands separator or a decimal one."""
DAYS = (20_000.0, 80_000.0)
"""Spreadsheets number days; from 1954 to 2119 they have these numbers."""
KMH = 3.6
PER_MINUTE = 60.0
SECONDS_PER_HOUR = 3600.0

Read = tuple[list[Line], datetime | None]


def lines_of_table(words: Words, findings: Findings) -> Read:
    """Returns the lines of a table and the stamp of its second 0.

    Its first row names the columns. Raises CorampError where columns are missing.
    """
    (_, head), *rows = words
    head = [name.lower() for name in head]
    if tuple(head[:3]) == DFROUTER:
        return _lines_of_dfrouter([name.strip() for name in head], rows, findings), None
    places = _places(head)
    raw = [_Raw(number, row, places, findings) for number, row in rows]
    raw = [line for line in raw if line.is_whole(len(head))]
    begins, start = _begins(raw, findings)
    ends = _ends(raw, begins, start, findings)
    lines = []
    for line, begin_s, end_s in zip(raw, begins, ends, strict=True):
        if not math.isnan(begin_s) and not math.isnan(end_s):
            lines.append(line.as_line(begin_s, end_s))
    return lines, start


def _places(head: Sequence[str]) -> dict[str, int]:
    """Returns where each column is; raises CorampError for unknown, missing and doubled ones."""
    places: dict[str, int] = {}
    known = [*COLUMNS, *ALSO]
    for place, name in enumerate(head):
        column = ALSO.get(name, name)
        if column not in COLUMNS:
            near = difflib.get_close_matches(name, known, 1)
            hint = f" (did you mean {near[0]}?)" if near else ""
            raise CorampError(f"row 1: column {name!r} is not known{hint}; allowed {NAMES}")
        if column in places:
            raise CorampError(f"row 1: column {column} is there twice; allowed is once")
        places[column] = place
    missing = [name for name in (BEGIN, DETECTOR) if name not in places]
    if not {VEHICLES, PER_HOUR} & places.keys():
        missing.append(VEHICLES)
    if missing:
        raise CorampError(f"row 1: there is no column {', '.join(missing)}; allowed {NAMES}")
    for pair in ((VEHICLES, PER_HOUR), (SPEED_MPS, SPEED_KMH)):
        if set(pair) <= places.keys():
            raise CorampError(f"row 1: has both {pair[0]} and {pair[1]}; allowed is one of them")
    return places


class _Raw:
    """One row of a table, and what its words say."""

    def __init__(
        self, number: int, words: Sequence[str], places: Mapping[str, int], findings: Findings
    ) -> None:
        self.number = number
        self._words = words
        self._places = places
        self._findings = findings

    def is_whole(self, columns: int) -> bool:
        """Returns whether it has a word for each column, and tells if not."""
        if len(self._words) != columns:
            what = f"has {len(self._words)} values in a table of {columns} columns"
            self._findings.tell(self.number, what, f"are {columns} values")
        return len(self._words) == columns

    def has(self, column: str) -> bool:
        return column in self._places and self.word(column) != ""

    def word(self, column: str) -> str:
        return self._words[self._places[column]] if column in self._places else ""

    def number_of(self, column: str, otherwise: float = math.nan) -> float:
        """Returns a number, NaN and a problem where it is none."""
        return number_in(self.word(column), column, self.number, self._findings, otherwise)

    @property
    def stream(self) -> tuple[str, int, str]:
        lane = self.lane
        return self.word(DETECTOR), -1 if lane is None else lane, self.word(CLASS) or CAR

    @property
    def lane(self) -> int | None:
        word = self.word(LANE)
        if word in ("", "None", "null"):
            return None
        return int(word) if word.isdecimal() and int(word) <= MOST_LANE else -1

    def as_line(self, begin_s: float, end_s: float) -> Line:
        """Returns the line, with numbers as they are."""
        if not self.has(DETECTOR):
            self._findings.tell(self.number, "has no detector", "is a name in each row")
        lane = self.lane
        if lane == -1:
            what = f"lane is {self.word(LANE)!r}"
            self._findings.tell(self.number, what, f"are 0 (the rightmost) to {MOST_LANE}")
        if self.has(PER_HOUR):
            flow = self.number_of(PER_HOUR)
            vehicles = self._vehicles_of(flow, end_s - begin_s)
        elif self.has(VEHICLES):
            vehicles = self.number_of(VEHICLES)
        else:
            self._findings.tell(self.number, "has no count", "is a whole number", "left open")
            vehicles = math.nan
        return Line(
            self.number,
            begin_s,
            end_s,
            self.word(DETECTOR),
            lane,
            self.word(CLASS) or CAR,
            vehicles,
            self._speed_mps(),
        )

    def _vehicles_of(self, flow_veh_h: float, length_s: float) -> float:
        """How many vehicles a flow is; fractions are told of the file, if they are not mended."""
        vehicles = flow_veh_h * length_s / SECONDS_PER_HOUR
        if not math.isfinite(vehicles):
            return math.nan
        if abs(vehicles - round(vehicles)) >= 1e-3 and self._findings.repair:
            return vehicles
        if abs(vehicles - round(vehicles)) >= 1e-3:
            what = f"{flow_veh_h:g} veh/h are {vehicles:g} vehicles in {length_s:g} s"
            allowed = "are whole numbers of vehicles in every row; "
            allowed += "counts of an interval belong into the column vehicles"
            self._findings.tell_once(PER_HOUR, self.number, what, allowed)
        return float(round(vehicles))

    def _speed_mps(self) -> float | None:
        column, unit = (SPEED_MPS, 1.0) if SPEED_MPS in self._places else (SPEED_KMH, KMH)
        if not self.has(column):
            return None
        speed = self.number_of(column)
        return None if math.isnan(speed) else speed / unit


def number_in(
    word: str, column: str, row: int, findings: Findings, otherwise: float = math.nan
) -> float:
    """Returns the number that a word is; decimal commas and thousands are told, or mended."""
    if word == "":
        return otherwise
    plain = _without_thousands(word)
    if plain is not None:
        what = f"{column} is {word!r}, with a thousands separator"
        if not findings.tell(row, what, f"is {plain}", f"taken as {plain}"):
            return otherwise
        word = plain
    elif TWO_MEANINGS.fullmatch(word) and column in (COUNTED if "," in word else WHOLE):
        what = f"{column} is {word!r}, with a thousands separator or decimals"
        findings.tell(row, what, "is a number without thousands separators and decimal commas")
        return otherwise
    elif word.count(",") == 1 and "." not in word:
        what = f"{column} is {word!r}, with a decimal comma"
        allowed = "is a decimal point in every row"
        if not findings.tell_once("comma", row, what, allowed, "taken as a point in every row"):
            return otherwise
        word = word.replace(",", ".")
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        findings.tell(row, f"{column} is {word!r}", "is a finite number")
        return otherwise
    return value


def _without_thousands(word: str) -> str | None:
    """Returns a number without its thousands separators; None where it has none for sure."""
    for form in THOUSANDS:
        if found := form.fullmatch(word):
            rest = found["rest"]
            whole = re.sub(r"\D", "", word[: len(word) - len(rest)])
            return whole + rest.replace(",", ".")
    return None


def _begins(raw: Sequence[_Raw], findings: Findings) -> tuple[list[float], datetime | None]:
    """When each row begins (s), and the stamp of second 0."""
    stamps, numbers = [], []
    for line in raw:
        word = line.word(BEGIN)
        stamp = None if _is_number(word) else stamp_of(word)
        if stamp is None:
            allowed = TIMES_ALLOWED
            if not _is_number(word):
                findings.tell(line.number, f"time is {word!r}", allowed)
            numbers.append((line, line.number_of(BEGIN) if _is_number(word) else math.nan))
        else:
            stamps.append((line, stamp))
    if not stamps:
        _check_seconds(raw, [value for _, value in numbers])
        return [value for _, value in numbers], None
    odd = [line for line, value in numbers if not math.isnan(value)]
    naive = [line for line, stamp in stamps if stamp.tzinfo is None]
    if odd or 0 < len(naive) < len(stamps):
        row = (odd or naive)[0].number
        raise CorampError(f"row {row}: its time is unlike the others'; allowed is one kind")
    kept = without_clock_changes(
        [stamp for _, stamp in stamps],
        [line.stream for line, _ in stamps],
        [line.number for line, _ in stamps],
        findings,
    )
    start = min(kept)
    seconds = {
        id(line): (stamp - start).total_seconds()
        for (line, _), stamp in zip(stamps, kept, strict=True)
    }
    return [seconds.get(id(line), math.nan) for line in raw], start


def _check_seconds(raw: Sequence[_Raw], times: Sequence[float]) -> None:
    """Raises CorampError for numbers of days, as spreadsheets have them."""
    known = sorted({time for time in times if not math.isnan(time)})
    steps = [b - a for a, b in pairwise(known)]
    if steps and DAYS[0] < known[0] and known[-1] < DAYS[1] and min(steps) < 0.5:
        row, word = raw[0].number, raw[0].word(BEGIN)
        raise CorampError(
            f"row {row}: time is {word!r}, a spreadsheet's number of days; allowed {TIMES_ALLOWED}"
        )


def _is_number(word: str) -> bool:
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


def _ends(
    raw: Sequence[_Raw], begins: Sequence[float], start: datetime | None, findings: Findings
) -> list[float]:
    """When each row ends (s): as told, or by the interval that most rows keep."""
    usual_s = _usual_interval_s(raw, begins)
    if math.isnan(usual_s) and not all(line.has(END) for line in raw):
        if findings.problems:
            return [math.nan] * len(raw)  # it only follows from what is told already
        raise CorampError(
            "row 2: no interval is known, as no detector has rows at two times; "
            "allowed is a column end_s, or two intervals at least"
        )
    ends = []
    for line, begin_s in zip(raw, begins, strict=True):
        word = line.word(END)
        stamp = None if _is_number(word) else stamp_of(word)
        if word == "":
            ends.append(begin_s + usual_s)
        elif stamp is not None and start is not None:
            ends.append(begin_s + _length_s(stamp_of(line.word(BEGIN)), stamp, usual_s))
        else:
            ends.append(line.number_of(END))
    return ends


def _length_s(begin: datetime | None, end: datetime, usual_s: float) -> float:
    """How long it is from stamp to stamp; a change of clocks within it counts for nothing."""
    if begin is None or (begin.tzinfo is None) != (end.tzinfo is None):
        return math.nan
    length_s = (end - begin).total_seconds()
    changed = begin.tzinfo is None and abs(abs(length_s - usual_s) - SECONDS_PER_HOUR) < 1e-6
    return usual_s if changed else length_s


def _usual_interval_s(raw: Sequence[_Raw], begins: Sequence[float]) -> float:
    """The step between rows of one stream that is seen most often, the shortest of several."""
    by_stream: dict[tuple[str, int, str], set[float]] = {}
    for line, begin_s in zip(raw, begins, strict=True):
        if not math.isnan(begin_s):
            by_stream.setdefault(line.stream, set()).add(begin_s)
    steps: Counter[float] = Counter()
    for times in by_stream.values():
        ordered = sorted(times)
        steps.update(b - a for a, b in pairwise(ordered))
    if not steps:
        return math.nan
    most = max(steps.values())
    return min(step for step, times in steps.items() if times == most)


def _lines_of_dfrouter(head: Sequence[str], rows: Words, findings: Findings) -> list[Line]:
    """The lines of ``Detector;Time;qPKW;vPKW;qLKW;vLKW``, which dfrouter and flowrouter read.

    Times are minutes, speeds km/h, counts vehicles of the interval.
    """
    kinds = [(CAR, "qpkw", "vpkw"), (TRUCK, "qlkw", "vlkw")]
    kinds = [kind for kind in kinds if kind[1] in head]
    unknown = set(head) - {"detector", "time", "qpkw", "vpkw", "qlkw", "vlkw"}
    if unknown:
        raise CorampError(
            f"row 1: column {min(unknown)!r} is not known; "
            "allowed are Detector;Time;qPKW;vPKW;qLKW;vLKW"
        )
    whole = [(number, row) for number, row in rows if len(row) == len(head)]
    for number, row in rows:
        if len(row) != len(head):
            what = f"has {len(row)} values in a table of {len(head)} columns"
            findings.tell(number, what, f"are {len(head)} values")
    begins: list[float] = []
    for number, row in whole:
        begins.append(PER_MINUTE * number_in(row[1], "Time", number, findings))
    step_s = _step_between(sorted({time for time in begins if not math.isnan(time)}))
    lines = []
    for (number, row), begin_s in zip(whole, begins, strict=True):
        by_name = dict(zip(head, row, strict=True))
        for kind, count, speed in kinds:
            vehicles = number_in(by_name[count], count, number, findings)
            kmh = number_in(by_name.get(speed, ""), speed, number, findings)
            seen = vehicles > 0.0 and not math.isnan(kmh)
            speed_mps = kmh / KMH if seen else None
            end_s = begin_s + step_s
            lines.append(Line(number, begin_s, end_s, row[0], None, kind, vehicles, speed_mps))
    return [line for line in lines if not math.isnan(line.begin_s)]


def _step_between(times_s: Sequence[float]) -> float:
    """The shortest step between times, a minute where there is only one."""
    steps = [b - a for a, b in pairwise(times_s)]
    return min(steps, default=PER_MINUTE)
