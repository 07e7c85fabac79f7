"""Reads a log of messages back, and refuses in one line what cannot be one."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.errors import CorampError
from coramp.messages.kinds import (
    CODES,
    COLUMNS,
    COMMAND,
    END,
    ENTRY,
    KINDS,
    LOG_VERSION,
    PIECES,
    REQUEST,
    name_in_order,
    place_of_each,
)
from coramp.road.streams import STREAMS


@dataclass(frozen=True)
class MessageLog:
    """A log that could be read: one entry a message in each array, numbers nan where there is none.

    ``codes`` are the messages' kinds, as ``kinds.CODES`` numbers them. ``vehicle`` is the number
    of its vehicle's request, -1 where there is none; ``strangers`` are rows about vehicles of the
    run that never asked to enter. ``requests`` are the rows of the requests, by number.
    ``places`` are the messages' rows in the file. Commands' pieces are ``pieces[first[row] :
    first[row + 1]]``.
    """

    path: Path
    frame: pl.DataFrame
    places: IntArray
    codes: IntArray
    step: IntArray
    vehicle: IntArray
    requests: IntArray
    strangers: IntArray
    first: IntArray
    pieces: FloatArray

    def of_kind(self, *kinds: str) -> IntArray:
        """Returns the rows of these kinds."""
        return np.flatnonzero(np.isin(self.codes, [CODES[kind] for kind in kinds]))

    def numbers(self, column: str) -> FloatArray:
        """Returns a column of numbers, nan where there is none."""
        return self.frame[column].fill_null(np.nan).to_numpy()

    def vehicle_id(self, number: int) -> str:
        """Returns the name of a vehicle."""
        return str(self.frame["vehicle_id"][int(self.requests[number])])

    @property
    def end_step(self) -> int:
        """When the run ended."""
        return int(self.step[-1])


class OutOfOrderError(CorampError):
    """Messages are not in their order; ``row`` is the first that is out of place.

    ``alone`` tells that all the others are in order.
    """

    def __init__(self, message: str, row: int, alone: bool) -> None:
        super().__init__(message)
        self.row, self.alone = row, alone


def read_log(
    path: Path, step_s: float, of_run: Collection[str], put_in_order: bool = False
) -> MessageLog:
    """Returns a log; raises CorampError for one that is not whole, in order, known and finite.

    ``of_run`` are the vehicles of the run: a message about any other is refused. ``put_in_order``
    puts messages into their order where they are not in it.
    """
    frame = _read(path)
    _check_values(path, frame)
    step = _checked_steps(path, frame, step_s)
    keys = _order_of(frame)
    places = np.arange(frame.height)
    if put_in_order:
        places = np.argsort(keys, kind="stable")
        frame, keys, step = frame[places], keys[places], step[places]
    _check_order(path, frame, keys)
    _check_end(path, frame)
    codes = frame["kind"].replace_strict(CODES).to_numpy()
    vehicle, requests, strangers = _vehicles(path, frame, of_run)
    counts = frame[PIECES[0]].list.len().fill_null(0).to_numpy()
    commands = frame.filter(pl.col("kind").is_in([ENTRY, COMMAND]))
    pieces = np.column_stack([commands[name].explode().to_numpy() for name in PIECES])
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    return MessageLog(path, frame, places, codes, step, vehicle, requests, strangers, first, pieces)


def _read(path: Path) -> pl.DataFrame:
    if not path.exists():
        raise CorampError(f"{path}: no such file; run again with --keep-messages")
    try:
        frame = pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise CorampError(f"{path}: cannot be read: {error}; run again") from None
    versions = frame["version"].unique().to_list() if "version" in frame.columns else [None]
    if frame.height and versions != [LOG_VERSION]:
        told = next(version for version in versions if version != LOG_VERSION)
        raise CorampError(f"{path}: version: {told} cannot be read; allowed is {LOG_VERSION}")
    if dict(frame.schema) != {name: _plain(dtype) for name, dtype in COLUMNS.items()}:
        wrong = [n for n, dtype in COLUMNS.items() if frame.schema.get(n) != _plain(dtype)]
        wrong += [n for n in frame.columns if n not in COLUMNS]
        raise CorampError(
            f"{path}: columns are not those of version {LOG_VERSION} "
            f"({', '.join(wrong) or 'order'}); allowed are {', '.join(COLUMNS)}"
        )
    if frame.is_empty():
        raise CorampError(
            f"{path}: is empty; allowed is a log that ends with a message of kind {END}"
        )
    return frame


def _plain(dtype: pl.DataType | type[pl.DataType]) -> pl.DataType:
    return dtype() if isinstance(dtype, type) else dtype


def _refuse(path: Path, frame: pl.DataFrame, wrong: BoolArray, told: str) -> None:
    """Raises CorampError about the first row that is wrong; ``told`` may name its columns."""
    rows = np.flatnonzero(wrong)
    if len(rows) == 0:
        return
    row = int(rows[0])
    said = frame.row(row, named=True)
    about = f", {said['vehicle_id']}" if said["vehicle_id"] is not None else ""
    place = f"{path}: row {row} ({said['time_s']} s{about}, {said['kind']})"
    raise CorampError(f"{place}: {told.format(**said)}")


def _check_values(path: Path, frame: pl.DataFrame) -> None:
    """Refuses kinds that are none, numbers that are not finite, and columns not of the kind."""
    kinds = ", ".join(KINDS)
    known = frame["kind"].is_in(list(KINDS)).fill_null(value=False).to_numpy()
    _refuse(path, frame, ~known, f"there is no kind {{kind!r}}; allowed are {kinds}")
    for name, dtype in COLUMNS.items():
        if dtype == pl.Float64:
            wrong = ~frame[name].is_finite().fill_null(name != "time_s").to_numpy()
            _refuse(path, frame, wrong, f"{name} {{{name}}} cannot be; allowed are finite numbers")
        if name in PIECES:
            finite = pl.element().is_finite().fill_null(value=False).all()
            whole = frame[name].list.eval(finite).list.first().fill_null(value=True).to_numpy()
            _refuse(path, frame, ~whole, f"{name}: allowed are finite numbers")
    for said, known_kind in KINDS.items():
        here = (frame["kind"] == said).to_numpy()
        for name in known_kind.needs:
            lacks = here & frame[name].is_null().to_numpy()
            _refuse(path, frame, lacks, f"has no {name}; allowed is a value")
        for name in known_kind.lacks:
            has = here & frame[name].is_not_null().to_numpy()
            told = f"a message of kind {said} has no such column; allowed is null"
            _refuse(path, frame, has, f"{name} {{{name}}}: {told}")
    counts = np.column_stack([frame[n].list.len().fill_null(0).to_numpy() for n in PIECES])
    commands = frame["kind"].is_in([ENTRY, COMMAND]).to_numpy()
    uneven = (counts != counts[:, :1]).any(axis=1) | (commands != (counts[:, 0] > 0))
    _refuse(path, frame, uneven, "its pieces are not whole; allowed are as many of each number")
    streams = frame["stream"].is_in(STREAMS).fill_null(value=True).to_numpy()
    _refuse(path, frame, ~streams, "there is no stream {stream!r}; allowed are mainline and ramp")


def _order_of(frame: pl.DataFrame) -> IntArray:
    """Returns what messages are ordered by: time, then kind, then for positions the vehicle."""
    place = frame.select(place_of_each()).to_series().to_numpy()
    name = frame.select(name_in_order().fill_null("")).to_series().to_numpy()
    _, time = np.unique(frame["time_s"].to_numpy(), return_inverse=True)
    names, name = np.unique(name, return_inverse=True)
    return np.asarray((time * len(KINDS) + place) * len(names) + name, np.int64)


def _check_order(path: Path, frame: pl.DataFrame, keys: IntArray) -> None:
    """Raises OutOfOrderError where messages are not in order."""
    back = np.flatnonzero(keys[1:] < keys[:-1])
    if len(back) == 0:
        return
    row = int(back[0])
    told = "comes before earlier messages"
    around = keys[max(0, row - 1) : row + 3]
    rest = np.delete(around, min(row, 1) + 1)
    if not (rest[1:] < rest[:-1]).any():  # not the former of the two is out of place, or either
        row, told = row + 1, "comes after a later message"
    others = np.delete(keys, row)
    alone = bool((others[1:] >= others[:-1]).all())
    said = frame.row(row, named=True)
    about = f", {said['vehicle_id']}" if said["vehicle_id"] is not None else ""
    raise OutOfOrderError(
        f"{path}: row {row} ({said['time_s']} s{about}, {said['kind']}): {told}; allowed are "
        "messages by time, then kind and vehicle, as they were told",
        row,
        alone,
    )


def _checked_steps(path: Path, frame: pl.DataFrame, step_s: float) -> IntArray:
    """Returns the steps of all messages; refuses what is off the clock, or before its time."""
    time_s = frame["time_s"].to_numpy()
    step = np.rint(time_s / step_s).astype(np.int64)
    off = (step * step_s != time_s) | (time_s < 0.0)
    _refuse(path, frame, off, f"is no step of the control clock; allowed are multiples of {step_s}")
    early = (frame["of_s"] > frame["time_s"]).fill_null(value=False).to_numpy()
    _refuse(path, frame, early, "tells of {of_s} s, before its time; allowed is up to {time_s} s")
    return step


def _check_end(path: Path, frame: pl.DataFrame) -> None:
    """Refuses a log that is cut, or goes on after its end."""
    ends = (frame["kind"] == END).to_numpy()
    if not ends.any() or not ends[-1]:
        raise CorampError(
            f"{path}: row {frame.height - 1}: the log is cut there; allowed is one that ends with "
            f"a message of kind {END}"
        )
    _refuse(path, frame, ends[:-1], "comes before other messages; allowed is one, as the last")


def _vehicles(
    path: Path, frame: pl.DataFrame, of_run: Collection[str]
) -> tuple[IntArray, IntArray, IntArray]:
    """Returns each message's vehicle, the requests' rows, and the rows about strangers."""
    requests = np.flatnonzero((frame["kind"] == REQUEST).to_numpy())
    asked = frame["vehicle_id"].gather(requests).to_list()
    number = {name: k for k, name in enumerate(asked)}
    twice = np.zeros(frame.height, np.bool_)
    twice[requests] = np.array([number[name] != k for k, name in enumerate(asked)], np.bool_)
    # the last of two keeps its number, so that it is the first that stands out
    _refuse(path, frame, twice, "asks to enter twice; allowed is once")
    names = frame["vehicle_id"]
    vehicle = names.replace_strict(number, default=-1, return_dtype=pl.Int64).to_numpy()
    about = names.is_not_null().to_numpy()
    known = names.is_in(list(of_run)).fill_null(value=True).to_numpy()
    _refuse(path, frame, ~known, "there is no such vehicle in the run; allowed are those of it")
    rows = np.arange(frame.height)
    early = about & (vehicle >= 0)
    early[early] = rows[early] < requests[vehicle[early]]
    if early.any():
        asks = requests[vehicle[np.argmax(early)]]
        told = f"comes before its vehicle asks to enter, in row {asks}; allowed is after that"
        _refuse(path, frame, early, told)
    return vehicle, requests, np.flatnonzero(about & (vehicle < 0))
