"""A table of counts, the lines that a file gives for it, and what is said of them."""

from collections.abc import Collection
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple

import polars as pl

SCHEMA: dict[str, pl.DataType | type[pl.DataType]] = {
    "begin_s": pl.Float64,
    "end_s": pl.Float64,
    "detector": pl.String,
    "lane": pl.Int64,
    "vehicle_class": pl.String,
    "vehicles": pl.Int64,
    "mean_speed_mps": pl.Float64,
}
"""The columns of counts; ``lane``, 0 being the rightmost, and ``mean_speed_mps`` may be null."""
CAR, TRUCK = "car", "truck"
BESIDE = "+"
"""It stands between the names of detectors that lie beside each other, one a lane."""
NAMED_AT_MOST = 10
"""So many lines are told of a file, and then how many more there are."""
SHORTEST_S, LONGEST_S = 60.0, 3600.0
"""How long an interval of counts may be; the last one of a file may be shorter."""


class Line(NamedTuple):
    """One count as a file gives it, with the row that it stands in.

    Times in s, from the first of the file where it has time stamps. ``vehicles`` may be anything
    that is a number, NaN where it is not known.
    """

    row: int
    begin_s: float
    end_s: float
    detector: str
    lane: int | None
    vehicle_class: str
    vehicles: float
    mean_speed_mps: float | None

    @property
    def place(self) -> tuple[str, int]:
        """Where it was counted: detector and lane, -1 for all lanes; sorts."""
        return self.detector, -1 if self.lane is None else self.lane

    @property
    def stream(self) -> tuple[str, int, str]:
        """What was counted: place and class; sorts."""
        return *self.place, self.vehicle_class

    @property
    def where(self) -> str:
        """The place in words."""
        return self.detector if self.lane is None else f"{self.detector} lane {self.lane}"


@dataclass(frozen=True)
class Problem:
    """What does not add up: in which row (0 for the whole file), what, and what is allowed."""

    row: int
    what: str
    allowed: str

    def line(self, file: str) -> str:
        """Returns it in one line."""
        row = f"row {self.row}: " if self.row else ""
        return f"{file}: {row}{self.what}; allowed {self.allowed}"


@dataclass(frozen=True)
class Repair:
    """What was changed so that a file adds up: in which row (0 for the whole file), and how."""

    row: int
    what: str

    def line(self, file: str) -> str:
        """Returns it in one line."""
        row = f"row {self.row}: " if self.row else ""
        return f"{file}: {row}{self.what}"


@dataclass
class Findings:
    """What is found while a file is read; with ``repair``, what can be mended is mended."""

    repair: bool
    problems: list[Problem] = field(default_factory=list)
    repairs: list[Repair] = field(default_factory=list)
    _of_the_file: dict[str, bool] = field(default_factory=dict)

    def tell(self, row: int, what: str, allowed: str, mended: str = "") -> bool:
        """Notes what is wrong; returns whether to mend it, in the way that ``mended`` says."""
        if self.repair and mended:
            self.repairs.append(Repair(row, f"{what}: {mended}"))
            return True
        self.problems.append(Problem(row, what, allowed))
        return False

    def tell_once(self, kind: str, row: int, what: str, allowed: str, mended: str = "") -> bool:
        """Notes what the whole file has wrong, at the first row that shows it; see ``tell``."""
        if kind not in self._of_the_file:
            self._of_the_file[kind] = self.tell(row, what, allowed, mended)
        return self._of_the_file[kind]


@dataclass(frozen=True)
class Counts:
    """Counts of detectors, sorted by time, detector, lane and class, with the repairs of the file.

    ``frame`` has the columns of ``SCHEMA``: one row for each interval, detector, lane and class,
    none twice and none left out. ``start`` is the time stamp of second 0, if the file has stamps.
    """

    frame: pl.DataFrame
    source: str = ""
    start: datetime | None = None
    repairs: tuple[Repair, ...] = ()

    @property
    def detectors(self) -> list[str]:
        """The detectors, sorted."""
        return sorted(self.frame["detector"].unique().to_list())

    @property
    def classes(self) -> list[str]:
        """The classes of vehicles, sorted."""
        return sorted(self.frame["vehicle_class"].unique().to_list())

    @property
    def begin_s(self) -> float:
        """When the first interval begins."""
        return float(self.frame["begin_s"].min())  # type: ignore[arg-type]

    @property
    def end_s(self) -> float:
        """When the last interval ends."""
        return float(self.frame["end_s"].max())  # type: ignore[arg-type]

    @property
    def interval_s(self) -> float:
        """How long an interval is, but the last one."""
        return float((self.frame["end_s"] - self.frame["begin_s"]).max())  # type: ignore[arg-type]

    def has(self, detector: str) -> bool:
        """Returns whether there is a detector, or each of a row of them."""
        known = self.detectors
        return all(name in known for name in in_row(detector, known))

    def at(self, detector: str) -> pl.DataFrame:
        """Returns the rows of a detector; of several in a row, each with the lane of its place."""
        names = in_row(detector, self.detectors)
        if len(names) == 1:
            return self.frame.filter(pl.col("detector") == detector)
        return pl.concat(
            self.frame.filter(pl.col("detector") == name).with_columns(
                detector=pl.lit(detector), lane=pl.lit(lane, pl.Int64)
            )
            for lane, name in enumerate(names)
        ).sort("begin_s", "lane", "vehicle_class")


def in_row(detector: str, known: Collection[str]) -> list[str]:
    """Returns the detectors that a name stands for: ``A+B`` for A on lane 0 and B on lane 1."""
    return [detector] if detector in known else detector.split(BESIDE)


def counts_of(
    lines: list[Line], source: str, start: datetime | None, repairs: list[Repair]
) -> Counts:
    """Returns the table of lines that add up."""
    rows = [(*line[1:6], round(line.vehicles), line.mean_speed_mps) for line in lines]
    frame = pl.DataFrame(rows, schema=SCHEMA, orient="row").sort(
        "begin_s", "detector", "lane", "vehicle_class"
    )
    return Counts(frame, source, start, tuple(repairs))


def told_briefly(lines: list[str]) -> list[str]:
    """Returns the first lines, and a last one that says how many more there are."""
    more = len(lines) - NAMED_AT_MOST
    return lines if more <= 0 else [*lines[:NAMED_AT_MOST], f"and {more} more"]
