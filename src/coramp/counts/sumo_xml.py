"""Lines of counts from SUMO's own XML: induction loops, route files and flow files."""

import io
import math
import xml.sax
import xml.sax.handler
from collections.abc import Mapping
from typing import Any

from coramp.counts.table import CAR, LONGEST_S, Findings, Line
from coramp.errors import CorampError

LOOP, FLOW, TYPE, ROUTE = "interval", "flow", "vType", "route"
VEHICLES = ("vehicle", "trip")
TIMES = ("begin", "end", "depart")
UNITS_S = (1.0, 60.0, 3600.0, 86_400.0)
COUNTED_S = 300.0
"""Vehicles of a route file are counted in intervals of so many seconds."""
LATEST_S = 31.0 * 86_400.0
"""No vehicle comes later: a month."""
NOT_KNOWN = "DEFAULT_VEHTYPE"
ALLOWED = "are <interval>, <flow>, <vehicle> and <trip> of SUMO"


def lines_of_xml(content: bytes, findings: Findings) -> list[Line]:
    """Returns the lines of a file of SUMO's; raises CorampError where it is none.

    A loop's vehicles are those that it saw pass in the interval (``nVehContrib``). Flows and
    vehicles count at the first edge of their way; a class is the name of the type, ``car`` where
    none is given.
    """
    reader = _Reader(findings)
    parser = xml.sax.make_parser()  # noqa: S317 - files of one's own, and no entities from outside
    parser.setFeature(xml.sax.handler.feature_external_ges, False)
    parser.setContentHandler(reader)
    try:
        parser.parse(io.BytesIO(content))
    except xml.sax.SAXParseException as error:
        row = error.getLineNumber()
        raise CorampError(
            f"row {row}: is cut off or no XML ({error.getMessage()}); allowed is a whole file"
        ) from None
    except LookupError as error:
        raise CorampError(f"row 1: {error}; allowed is UTF-8") from None
    if not reader.lines and not reader.departs and not findings.problems:
        raise CorampError(f"holds no counts; allowed {ALLOWED}")
    return [*reader.lines, *reader.counted()]


class _Reader(xml.sax.handler.ContentHandler):
    """Gathers lines while a file is parsed."""

    def __init__(self, findings: Findings) -> None:
        super().__init__()
        self.lines: list[Line] = []
        self.departs: list[tuple[int, float, str, str]] = []
        self._findings = findings
        self._routes: dict[str, str] = {}
        self._open: tuple[int, Mapping[str, str], str] | None = None
        self._locator: Any = None

    def setDocumentLocator(self, locator: Any) -> None:  # noqa: N802 - sax names it
        self._locator = locator

    def startElement(self, name: str, attrs: Any) -> None:  # noqa: N802 - sax names it
        row, values = int(self._locator.getLineNumber()), dict(attrs)
        if name == LOOP and "nVehContrib" in values:
            self._loop(row, values)
        elif name == ROUTE:
            self._route(values)
        elif name in (FLOW, *VEHICLES):
            self._open = (row, values, name)

    def endElement(self, name: str) -> None:  # noqa: N802 - sax names it
        if self._open is not None and name == self._open[2]:
            row, values, kind = self._open
            self._open = None
            (self._flow if kind == FLOW else self._vehicle)(row, values)

    def _route(self, values: Mapping[str, str]) -> None:
        first = next(iter(values.get("edges", "").split()), "")
        if self._open is None:
            self._routes[values.get("id", "")] = first
        else:
            row, own, kind = self._open
            self._open = (row, {**own, "from": first}, kind)

    def _number(self, row: int, values: Mapping[str, str], key: str) -> float:
        if key not in values:
            self._findings.tell(row, f"{key} is missing", "is a finite number")
            return math.nan
        try:
            value = _seconds_of(values[key]) if key in TIMES else float(values[key])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self._findings.tell(row, f"{key} is {values[key]!r}", "is a finite number")
        elif key in TIMES and not 0.0 <= value <= LATEST_S:
            self._findings.tell(row, f"{key} is {value:g} s", f"is 0 to {LATEST_S:.0f} s")
            return math.nan
        return value

    def _loop(self, row: int, values: Mapping[str, str]) -> None:
        begin_s, end_s = self._number(row, values, "begin"), self._number(row, values, "end")
        vehicles = self._number(row, values, "nVehContrib")
        speed_mps = None
        if "speed" in values:
            told = self._number(row, values, "speed")
            speed_mps = told if told >= 0.0 and vehicles > 0.0 else None
        name = values.get("id", "")
        if not name:
            self._findings.tell(row, "the interval has no id", "is that of its loop")
        elif math.isfinite(begin_s) and math.isfinite(end_s):
            self.lines.append(Line(row, begin_s, end_s, name, None, CAR, vehicles, speed_mps))

    def _flow(self, row: int, values: Mapping[str, str]) -> None:
        begin_s, end_s = self._number(row, values, "begin"), self._number(row, values, "end")
        if not (math.isfinite(begin_s) and math.isfinite(end_s)):
            return
        number = self._flow_number(row, values, end_s - begin_s)
        parts = max(1, math.ceil((end_s - begin_s) / LONGEST_S - 1e-9))
        place, kind = self._place(row, values), _class_of(values)
        for k in range(parts):
            until_s = begin_s + (k + 1) * (end_s - begin_s) / parts
            here = number
            if parts > 1:
                here = round(number * (k + 1) / parts) - round(number * k / parts)
            from_s = begin_s + k * (end_s - begin_s) / parts
            self.lines.append(Line(row, from_s, until_s, place, None, kind, here, None))

    def _flow_number(self, row: int, values: Mapping[str, str], length_s: float) -> float:
        if "number" in values:
            return self._number(row, values, "number")
        if "vehsPerHour" in values:
            return round(self._number(row, values, "vehsPerHour") * length_s / 3600.0, 6)
        period = values.get("period", "")
        if period and not period.startswith("exp"):
            each_s = self._number(row, values, "period")
            return float(math.ceil(length_s / each_s - 1e-9)) if each_s > 0.0 else math.nan
        self._findings.tell(row, "the flow has no number", "are number, vehsPerHour or period")
        return math.nan

    def _vehicle(self, row: int, values: Mapping[str, str]) -> None:
        depart_s = self._number(row, values, "depart")
        if math.isfinite(depart_s):
            place = self._place(row, values)
            self.departs.append((row, depart_s, place, _class_of(values)))

    def _place(self, row: int, values: Mapping[str, str]) -> str:
        place = values.get("from") or self._routes.get(values.get("route", ""), "")
        if not place:
            self._findings.tell(row, "has no known way", "are from, or a route with edges")
        return place

    def counted(self) -> list[Line]:
        """Returns the vehicles of a route file by interval, edge and class."""
        if not self.departs:
            return []
        last = math.floor(max(time for _, time, *_ in self.departs) / COUNTED_S)
        counts: dict[tuple[str, str], dict[int, int]] = {}
        rows: dict[tuple[str, str], int] = {}
        for row, depart_s, place, kind in self.departs:
            of_interval = counts.setdefault((place, kind), {})
            interval = math.floor(depart_s / COUNTED_S)
            of_interval[interval] = of_interval.get(interval, 0) + 1
            rows.setdefault((place, kind), row)
        return [
            Line(
                rows[stream], k * COUNTED_S, (k + 1) * COUNTED_S, stream[0], None, stream[1],
                float(of_interval.get(k, 0)), None,
            )
            for stream, of_interval in counts.items()
            for k in range(min(0, *of_interval), last + 1)
        ]  # fmt: skip


def _seconds_of(word: str) -> float:
    """Seconds, or SUMO's times by days, hours, minutes and seconds, separated by colons."""
    parts = [float(part) for part in word.split(":")]
    return sum(part * unit for part, unit in zip(reversed(parts), UNITS_S, strict=False))


def _class_of(values: Mapping[str, str]) -> str:
    kind = values.get("type", "")
    return CAR if kind in ("", NOT_KNOWN) else kind
