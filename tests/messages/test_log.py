"""The log of messages: what it holds, and what is refused in one line when it is read back."""

import numpy as np
import polars as pl
import pytest

from coramp.errors import CorampError
from coramp.messages.commands import Enter, Follow, SetSignal
from coramp.messages.events import DetectorReading, RequestToEnter
from coramp.messages.kinds import COLUMNS, KINDS, LOG_VERSION
from coramp.messages.log import NO_POSITIONS, Positions, Told, _row, as_frame
from coramp.messages.log_reader import read_log
from coramp.vehicles.traits import Traits

STEP_S = 0.1
EVERY = {"version", "time_s", "kind"}
CRUISE = np.array([[0.5, -1000.0, 20.0, 0.0]])
REQUESTS = [RequestToEnter("m1", False, 5, 20.0, 5.0), RequestToEnter("r1", True, 7, 16.0, 16.5)]
COMMANDS = [
    Enter("m1", 5, CRUISE, -np.inf),
    Enter("r1", 7, CRUISE, np.inf),
    Follow("r1", 9, np.array([[0.9, -992.0, 20.0, 0.0], [1.9, -972.0, 20.0, 0.0]]), 31.0),
]
REPORTS = Positions(
    np.array([0, 1]),
    np.array([10, 10]),
    np.array([1.0, 1.0]),
    np.array([-990.0, -295.2]),
    np.array([20.0, 16.0]),
    np.array([np.nan, np.nan]),
    np.zeros(2, np.bool_),
)


def log_frame():
    return as_frame(Told(REQUESTS, COMMANDS, REPORTS, (), 20), STEP_S)


def every_kind():
    """A log with a message of each kind, a truck's request and a report with an acceleration."""
    truck = RequestToEnter("t1", False, 8, 20.0, 16.5, "truck", Traits(16.5, 0.02, 3e-9, 1.0, 25.0))
    positions = Positions._make(np.concatenate([column, column]) for column in REPORTS)
    accel_mps2, comparison = np.array([np.nan, np.nan, 1.5, -1.5]), np.arange(4) == 3
    positions = positions._replace(accel_mps2=accel_mps2, comparison=comparison)
    reading = DetectorReading(1.0, 0.25, 0.5, 2)
    commands = [*COMMANDS, SetSignal(10, True)]
    return as_frame(Told([*REQUESTS, truck], commands, positions, [reading], 20), STEP_S)


def read(frame, folder):
    path = folder / "messages.parquet"
    frame.write_parquet(path)
    return read_log(path, STEP_S, {"m1", "r1", "r2", "t1"})


def refusal(frame, folder):
    with pytest.raises(CorampError) as caught:
        read(frame, folder)
    (line,) = caught.value.messages
    path = folder / "messages.parquet"
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")


def changed(frame, row, **values):
    columns = {
        name: pl.when(pl.int_range(pl.len()) == row)
        .then(pl.lit(value, COLUMNS[name]))
        .otherwise(pl.col(name))
        for name, value in values.items()
    }
    return frame.with_columns(**columns)


def test_everything_stands_in_the_order_in_which_it_was_told():
    frame = log_frame()
    assert list(frame.columns) == list(COLUMNS)
    assert frame["version"].unique().to_list() == [LOG_VERSION]
    told = frame.select("time_s", "kind", "vehicle_id").rows()
    assert told == [
        (0.5, "request", "m1"),
        (0.5, "entry", "m1"),
        (0.5, "acknowledgement", "m1"),
        (7 * STEP_S, "request", "r1"),
        (7 * STEP_S, "entry", "r1"),
        (7 * STEP_S, "acknowledgement", "r1"),
        (0.9, "command", "r1"),
        (0.9, "acknowledgement", "r1"),
        (1.0, "report", "m1"),
        (1.0, "report", "r1"),
        (2.0, "end", None),
    ]


def test_the_kinds_of_version_3():
    """Whoever changes these raises ``LOG_VERSION``."""
    position = {"vehicle_id", "of_s", "station_m", "speed_mps", "std_m"}
    trajectory = {"vehicle_id"} | {
        f"piece_{name}" for name in ("time_s", "station_m", "speed_mps", "accel_mps2")
    }
    expected = {
        "report": (0, position),
        "comparison": (4, position),
        "reading": (1, {"mainline_occupancy", "queue_occupancy", "passed_veh"}),
        "request": (2, {"vehicle_id", "stream", "speed_mps", "length_m", "vehicle_type"}),
        "entry": (3, trajectory),
        "command": (3, trajectory),
        "acknowledgement": (3, {"vehicle_id", "of_s"}),
        "signal": (3, {"green"}),
        "end": (5, set()),
    }
    assert LOG_VERSION == 3
    assert {name: (kind.place, set(kind.needs)) for name, kind in KINDS.items()} == expected


def test_each_message_has_the_columns_of_its_kind():
    frame, seen = every_kind(), set()
    for row in frame.iter_rows(named=True):
        has = {name for name, value in row.items() if value is not None}
        assert KINDS[row["kind"]].fits(has - EVERY), row
        seen.add(row["kind"])
    assert seen == set(KINDS)


def test_a_message_with_other_columns_is_not_written():
    with pytest.raises(ValueError, match="signal: has"):
        _row("signal", 0.0, green=True, speed_mps=1.0)
    with pytest.raises(ValueError, match="signal: has"):
        _row("signal", 0.0)


@pytest.mark.parametrize("name", KINDS)
def test_what_any_kind_needs_is_asked_for(name, tmp_path):
    for column in KINDS[name].needs:
        frame = every_kind()
        row = frame["kind"].to_list().index(name)
        line = refusal(changed(frame, row, **{column: None}), tmp_path)
        assert line.startswith(f"row {row} ")
        assert line.endswith(f"{name}): has no {column}; allowed is a value")


VALUES = {pl.Int64: 1, pl.Float64: 0.25, pl.String: "car", pl.Boolean: True}


@pytest.mark.parametrize("name", KINDS)
def test_a_value_that_a_kind_does_not_have_is_refused(name, tmp_path):
    frame, kind = every_kind(), KINDS[name]
    row = frame["kind"].to_list().index(name)
    assert {*kind.lacks, *kind.needs, *kind.may_have} | EVERY == set(COLUMNS)
    for column in kind.lacks:
        value = VALUES.get(COLUMNS[column], [0.5])
        line = refusal(changed(frame, row, **{column: value}), tmp_path)
        assert line.startswith(f"row {row} ")
        allowed = f"a message of kind {name} has no such column; allowed is null"
        assert line.endswith(f"{name}): {column} {value}: {allowed}")


def test_what_is_read_is_what_was_told(tmp_path):
    log = read(log_frame(), tmp_path)
    assert log.vehicle.tolist() == [0, 0, 0, 1, 1, 1, 1, 1, 0, 1, -1]
    assert log.requests.tolist() == [0, 3]
    assert log.end_step == 20
    first, last = log.first[6:8]
    np.testing.assert_array_equal(log.pieces[first:last], COMMANDS[2].pieces)
    assert log.frame["merge_time_s"].drop_nulls().to_list() == [31.0]


def test_readings_and_signals_of_a_metered_ramp_come_back(tmp_path):
    reading = DetectorReading(1.0, 0.25, 0.5, 2)
    told = Told(REQUESTS[:1], [SetSignal(10, False)], NO_POSITIONS, [reading], 20)
    log = read(as_frame(told, STEP_S), tmp_path)
    rows = log.frame.filter(pl.col("kind").is_in(["reading", "signal"]))
    assert rows["mainline_occupancy"].to_list() == [0.25, None]
    assert rows["passed_veh"].to_list() == [2, None]
    assert rows["green"].to_list() == [None, False]


def test_a_log_of_another_version_is_refused(tmp_path):
    line = refusal(log_frame().with_columns(version=pl.lit(1, pl.Int64)), tmp_path)
    assert line == "version: 1 cannot be read; allowed is 3"


def test_other_columns_are_refused(tmp_path):
    line = refusal(log_frame().drop("std_m"), tmp_path)
    assert line.startswith("columns are not those of version 3 (std_m); allowed are version, ")


def test_a_file_that_is_no_table_is_refused(tmp_path):
    (tmp_path / "messages.parquet").write_bytes(b"PAR1 and then nothing")
    with pytest.raises(CorampError, match="cannot be read"):
        read_log(tmp_path / "messages.parquet", STEP_S, set())


def test_a_log_that_is_not_there_says_how_to_get_one(tmp_path):
    with pytest.raises(CorampError, match="run again with --keep-messages"):
        read_log(tmp_path / "messages.parquet", STEP_S, set())


@pytest.mark.parametrize("rows", [0, 1, 7, 10])
def test_a_log_that_is_cut_is_refused(tmp_path, rows):
    line = refusal(log_frame().head(rows), tmp_path)
    assert line == (
        f"row {rows - 1}: the log is cut there; allowed is one that ends with a message of kind end"
        if rows
        else "is empty; allowed is a log that ends with a message of kind end"
    )


def test_messages_after_the_end_are_refused(tmp_path):
    frame = log_frame()
    line = refusal(pl.concat([frame, frame.tail(1)]), tmp_path)
    assert line.startswith("row 10 (2.0 s, end): comes before other messages")


def test_a_log_that_is_reordered_is_refused(tmp_path):
    frame = log_frame()
    line = refusal(frame[[0, 1, 2, 3, 4, 5, 8, 6, 7, 9, 10]], tmp_path)
    assert line == (
        "row 6 (1.0 s, m1, report): comes before earlier messages; "
        "allowed are messages by time, then kind and vehicle, as they were told"
    )


def test_a_message_off_the_clock_is_refused(tmp_path):
    line = refusal(changed(log_frame(), 6, time_s=0.93), tmp_path)
    assert line == (
        "row 6 (0.93 s, r1, command): is no step of the control clock; allowed are multiples of 0.1"
    )


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("name", ["time_s", "station_m", "speed_mps", "std_m"])
def test_a_number_that_is_not_finite_is_refused(tmp_path, name, value):
    line = refusal(changed(log_frame(), 8, **{name: value}), tmp_path)
    assert line.startswith("row 8 (")
    assert line.endswith(f"{name} {value} cannot be; allowed are finite numbers")


def test_a_piece_that_is_not_finite_is_refused(tmp_path):
    line = refusal(changed(log_frame(), 1, piece_station_m=[float("nan")]), tmp_path)
    assert line == "row 1 (0.5 s, m1, entry): piece_station_m: allowed are finite numbers"


def test_pieces_that_are_not_whole_are_refused(tmp_path):
    line = refusal(changed(log_frame(), 1, piece_station_m=[1.0, 2.0]), tmp_path)
    assert line.startswith("row 1 (0.5 s, m1, entry): its pieces are not whole")


def test_a_message_before_its_time_is_refused(tmp_path):
    line = refusal(changed(log_frame(), 8, of_s=1.5), tmp_path)
    assert (
        line == "row 8 (1.0 s, m1, report): tells of 1.5 s, before its time; allowed is up to 1.0 s"
    )


def test_a_message_before_its_vehicle_asked_is_refused(tmp_path):
    frame = log_frame()
    line = refusal(frame[[1, 0, *range(2, frame.height)]], tmp_path)
    assert line.startswith("row 1 (0.5 s, m1, request): comes after a later message")


def test_reports_of_one_time_stand_by_vehicle(tmp_path):
    frame = log_frame()
    line = refusal(frame[[*range(8), 9, 8, 10]], tmp_path)
    assert line.startswith("row 9 (1.0 s, m1, report): comes after a later message")


def test_a_message_before_its_vehicles_request_is_refused(tmp_path):
    line = refusal(changed(log_frame(), 1, vehicle_id="r1"), tmp_path)
    assert line == (
        "row 1 (0.5 s, r1, entry): comes before its vehicle asks to enter, in row 3; "
        "allowed is after that"
    )


def test_an_unknown_vehicle_is_refused(tmp_path):
    line = refusal(changed(log_frame(), 8, vehicle_id="m9"), tmp_path)
    assert line == (
        "row 8 (1.0 s, m9, report): there is no such vehicle in the run; allowed are those of it"
    )


def test_a_vehicle_of_the_run_that_never_asked_is_a_stranger(tmp_path):
    assert read(changed(log_frame(), 9, vehicle_id="r2"), tmp_path).strangers.tolist() == [9]


def test_an_unknown_kind_is_refused(tmp_path):
    line = refusal(changed(log_frame(), 8, kind="rumour"), tmp_path)
    assert line.startswith(
        "row 8 (1.0 s, m1, rumour): there is no kind 'rumour'; allowed are report"
    )


def test_what_a_kind_lacks_is_refused(tmp_path):
    line = refusal(changed(log_frame(), 0, length_m=None), tmp_path)
    assert line == "row 0 (0.5 s, m1, request): has no length_m; allowed is a value"


def test_asking_twice_is_refused(tmp_path):
    frame = log_frame()
    line = refusal(frame[[0, *range(frame.height)]], tmp_path)
    assert line == "row 0 (0.5 s, m1, request): asks to enter twice; allowed is once"
