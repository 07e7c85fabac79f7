"""``coramp audit``: what it confirms of every strategy, and what it catches."""

import json
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import coramp
from coramp.audit.audit import as_data, audit
from coramp.audit.verdicts import CONFIRMED, CONTRADICTED, UNCHECKED
from coramp.errors import CorampError
from coramp.messages.log_reader import _order_of
from coramp.strategies.registry import strategies
from tests.edges import invoke

COOPERATIVE = [name for name, strategy in strategies().items() if strategy.cooperative]
STEP_S = 0.1
CLAIMS = 28
SHORT = {"mainline_veh_h": 1500, "ramp_veh_h": 600, "horizon_s": 40, "keep_messages": True}


def verdicts(result):
    return {check.claim: check.verdict for check in result.checks}


@pytest.mark.parametrize("engine", ["exact", "sumo"])
@pytest.mark.parametrize("name", COOPERATIVE)
def test_every_cooperative_strategy_is_confirmed(tmp_path, name, engine):
    coramp.run("paper", name, engine=engine, out=tmp_path / "r", **SHORT)
    result = audit(tmp_path / "r")
    assert result.contradictions == []
    assert set(verdicts(result).values()) == {CONFIRMED}
    assert len(result.checks) == CLAIMS


@pytest.mark.parametrize("engine", ["exact", "sumo"])
@pytest.mark.parametrize(
    "settings",
    [
        {"safety.time_gap_s": 1.0, "safety.standstill_gap_m": 2.0},
        {"control.actuation_delay_s": 0.5, "safety.positioning_error_m": 0.3},
        {"control.step_s": 0.05, "mainline.entry_speed_mps": [17.0, 19.0]},
    ],
)
def test_other_settings_are_confirmed(tmp_path, settings, engine):
    coramp.run("paper", engine=engine, overrides=settings, out=tmp_path / "r", **SHORT)
    result = audit(tmp_path / "r")
    assert result.contradictions == []
    assert set(verdicts(result).values()) == {CONFIRMED}


@pytest.mark.parametrize(
    ("strategy", "settings"),
    [("uncontrolled", {}), ("mixed-slots", {"traffic.automated_share": 0.0})],
)
def test_of_drivers_it_confirms_reports_and_says_what_it_cannot(tmp_path, strategy, settings):
    coramp.run("paper", strategy, overrides=settings, out=tmp_path / "r", **SHORT)
    result = audit(tmp_path / "r")
    assert result.holds
    found = verdicts(result)
    assert found["reports"] == found["no vehicle was commanded"] == CONFIRMED
    assert found["min_margin_m"] == found["collisions"] == UNCHECKED
    assert "decisions" not in found


def test_the_signals_of_a_metered_ramp_are_decided_anew(tmp_path):
    metered = {
        "strategy.alinea.most_veh_h": 500.0,
        "strategy.alinea.target_occupancy_percent": 1.0,
        "strategy.alinea.update_s": 5.0,
    }
    coramp.run("paper", "alinea", overrides=metered, out=tmp_path / "r", **SHORT)
    frame = pl.read_parquet(tmp_path / "r" / "messages.parquet")
    assert (frame["kind"] == "signal").sum() > 2
    assert verdicts(audit(tmp_path / "r"))["decisions"] == CONFIRMED
    row = frame["kind"].to_list().index("signal")
    here = pl.int_range(pl.len()) == row
    turned = frame.with_columns(green=pl.when(here).then(~pl.col("green")).otherwise("green"))
    turned.write_parquet(tmp_path / "r" / "messages.parquet")
    (found,) = audit(tmp_path / "r").contradictions
    assert (found.row, found.against) == (row, "a decision")


class Run:
    """A run whose files can be changed, and audited."""

    def __init__(self, folder):
        self.folder = folder
        self.frame = pl.read_parquet(folder / "messages.parquet")

    def audited(self, frame, into):
        shutil.copytree(self.folder, into)
        frame.write_parquet(into / "messages.parquet")
        return audit(into)

    def rows(self, kind):
        return [k for k, found in enumerate(self.frame["kind"]) if found == kind]

    def middle(self, kind):
        rows = self.rows(kind)
        return rows[len(rows) // 2]

    def changed(self, row, name, change):
        here = pl.int_range(pl.len()) == row
        return self.frame.with_columns(pl.when(here).then(change).otherwise(name).alias(name))

    def moved(self, row, steps):
        """The log with a message told some steps later, in order of time, and its new row."""
        time_s = (round(self.frame["time_s"][row] / STEP_S) + steps) * STEP_S
        of_s = pl.when(pl.col("of_s") == pl.col("time_s")).then(time_s).otherwise("of_s")
        frame = self.changed(row, "of_s", of_s).with_row_index()
        here = pl.int_range(pl.len()) == row
        frame = frame.with_columns(time_s=pl.when(here).then(time_s).otherwise("time_s"))
        frame = frame[np.argsort(_order_of(frame), kind="stable")]
        return frame.drop("index"), frame["index"].to_list().index(row)

    def without(self, row):
        return self.frame.filter(pl.int_range(pl.len()) != row)


@pytest.fixture(scope="module", params=["exact", "sumo"])
def kept(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept") / "r"
    coramp.run(
        "paper",
        engine=request.param,
        mainline_veh_h=1800,
        ramp_veh_h=700,
        horizon_s=60,
        out=folder,
        keep_messages=True,
    )
    return Run(folder)


def rows_named(kept, frame, into):
    """The rows of all contradictions, or what is said of a log that cannot be one."""
    try:
        result = kept.audited(frame, into)
    except CorampError as refused:
        return str(refused)
    assert not result.holds
    return [found.row for found in result.contradictions]


@pytest.mark.parametrize(
    ("kind", "steps"),
    [
        *((kind, 3) for kind in ("report", "entry", "command", "acknowledgement")),
        *((kind, -3) for kind in ("report", "command", "request")),
    ],
)
def test_a_message_that_was_moved_contradicts(kept, tmp_path, kind, steps):
    frame, row = kept.moved(kept.middle(kind), steps)
    assert row in rows_named(kept, frame, tmp_path / "r")


@pytest.mark.parametrize(("kind", "steps"), [("request", 3), ("entry", -3)])
def test_an_entry_before_its_request_is_refused(kept, tmp_path, kind, steps):
    frame, row = kept.moved(kept.middle(kind), steps)
    told = rows_named(kept, frame, tmp_path / "r")
    assert f"row {row}" in told
    assert "comes before its vehicle asks to enter" in told


@pytest.mark.parametrize("kind", ["report", "entry", "command", "acknowledgement", "request"])
@pytest.mark.parametrize("steps", [-3, 3])
def test_another_time_on_a_message_that_stays_in_place_is_named(kept, tmp_path, kind, steps):
    row = kept.middle(kind)
    time_s = (round(kept.frame["time_s"][row] / STEP_S) + steps) * STEP_S
    told = rows_named(kept, kept.changed(row, "time_s", pl.lit(time_s)), tmp_path / "r")
    assert f"row {row} " in told if isinstance(told, str) else row in told


def test_two_messages_that_changed_places_are_refused(kept, tmp_path):
    one, other = kept.middle("command"), kept.middle("report")
    order = list(range(kept.frame.height))
    order[one], order[other] = other, one
    with pytest.raises(CorampError, match="allowed are messages by time"):
        kept.audited(kept.frame[order], tmp_path / "r")


def test_reports_of_one_time_that_changed_places_are_refused(kept, tmp_path):
    row = kept.middle("report")
    frame = kept.frame.with_row_index()
    beside = frame.filter(
        (pl.col("time_s") == kept.frame["time_s"][row])
        & (pl.col("kind") == "report")
        & pl.col("accel_mps2").is_null()
    )["index"].to_list()
    order = list(range(kept.frame.height))
    order[beside[0]], order[beside[1]] = beside[1], beside[0]
    with pytest.raises(CorampError, match=f"row {beside[1]} .*comes after a later message"):
        kept.audited(kept.frame[order], tmp_path / "r")


def test_a_later_end_contradicts_the_exits(kept, tmp_path):
    row = kept.frame.height - 1
    frame, _ = kept.moved(row, 5)
    result = kept.audited(frame, tmp_path / "r")
    assert [(found.row, found.kind) for found in result.contradictions] == [(row, "end")]


@pytest.mark.parametrize("kind", ["report", "entry", "command", "acknowledgement"])
def test_a_message_that_is_told_twice_is_named(kept, tmp_path, kind):
    row = kept.middle(kind)
    order = sorted([*range(kept.frame.height), row])
    result = kept.audited(kept.frame[order], tmp_path / "r")
    assert row + 1 in [found.row for found in result.contradictions]


@pytest.mark.parametrize("kind", ["report", "request", "entry", "command", "acknowledgement"])
def test_a_message_that_was_dropped_is_missed(kept, tmp_path, kind):
    row = kept.middle(kind)
    vehicle, time_s = kept.frame["vehicle_id"][row], kept.frame["time_s"][row]
    result = kept.audited(kept.without(row), tmp_path / "r")
    assert not result.holds
    lines = [found.line for found in result.contradictions]
    assert any(vehicle in line and f"{time_s:.3f} s" in line for line in lines), lines
    assert any(found.row is not None for found in result.contradictions)


@pytest.mark.parametrize("by_m", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["report", "entry", "command"])
def test_a_position_that_is_1_m_off_is_named(kept, tmp_path, kind, by_m):
    row = kept.middle(kind)
    name, place = "station_m", pl.col("station_m") + by_m
    if kind != "report":
        name = "piece_station_m"
        place = pl.col(name).list.eval(
            pl.element() + by_m * (pl.int_range(pl.len()) == pl.len() - 1)
        )
    result = kept.audited(kept.changed(row, name, place), tmp_path / "r")
    against = {found.against for found in result.contradictions if found.row == row}
    assert against >= ({"a commitment"} if kind == "report" else {"a decision"})


def test_a_whole_command_that_is_1_m_ahead_contradicts_kinematics_too(kept, tmp_path):
    row = kept.middle("command")
    ahead = pl.col("piece_station_m").list.eval(pl.element() + 1.0)
    result = kept.audited(kept.changed(row, "piece_station_m", ahead), tmp_path / "r")
    against = {found.against for found in result.contradictions if found.row == row}
    assert against >= {"kinematics", "a decision"}


@pytest.mark.parametrize(("std_m", "off_m", "holds"), [(0.3, 1.4, True), (0.3, 1.6, False)])
def test_reports_with_a_deviation_are_judged_at_five_of_it(kept, tmp_path, std_m, off_m, holds):
    rows = kept.frame.with_row_index().filter(
        (pl.col("kind") == "report") & pl.col("accel_mps2").is_null()
    )
    row = int(rows["index"][rows.height // 2])
    frame = kept.changed(row, "station_m", pl.col("station_m") + off_m)
    here = pl.int_range(pl.len()) == row
    frame = frame.with_columns(std_m=pl.when(here).then(std_m).otherwise("std_m"))
    assert kept.audited(frame, tmp_path / "r").holds == holds


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("min_margin_m", 0.9),
        ("min_ttc_s", 100.0),
        ("max_drac_mps2", 0.1),
        ("max_severity", 1.0),
        ("safety_violations", 1),
        ("collisions", 1),
        ("max_decel_mps2", None),
        ("interventions", 7),
        ("plan_error_m", 0.04),
        ("unserved", 1),
    ],
)
def test_a_figure_that_is_not_so_is_named(kept, tmp_path, name, value):
    shutil.copytree(kept.folder, tmp_path / "r")
    path = tmp_path / "r" / "run.json"
    content = json.loads(path.read_text())
    content["summary"][name] = value
    path.write_text(json.dumps(content))
    (found,) = audit(tmp_path / "r").contradictions
    assert found.against == "run.json"
    assert name in found.text


@pytest.mark.parametrize(
    ("table", "name"),
    [
        ("vehicles", "exit_s"),
        ("trajectories", "station_m"),
        ("decisions", "merge_time_s"),
        ("attempts", "missing_m"),
    ],
)
def test_a_table_that_is_not_so_is_named(kept, tmp_path, table, name):
    shutil.copytree(kept.folder, tmp_path / "r")
    path = tmp_path / "r" / f"{table}.parquet"
    frame = pl.read_parquet(path)
    here = pl.int_range(pl.len()) == frame.height // 2
    frame.with_columns(
        pl.when(here).then(pl.col(name).fill_null(0.0) + 1.0).otherwise(name).alias(name)
    ).write_parquet(path)
    (found,) = audit(tmp_path / "r").contradictions
    assert found.against == f"{table}.parquet"


def test_what_was_tried_is_not_confirmed_where_it_is_missing(kept, tmp_path):
    shutil.copytree(kept.folder, tmp_path / "r")
    (tmp_path / "r" / "attempts.parquet").unlink()
    result = audit(tmp_path / "r")
    assert verdicts(result)["attempts.parquet"] == UNCHECKED
    assert result.holds


def test_the_command_says_so_in_a_table_and_by_its_exit_code(kept, tmp_path):
    done = invoke("audit", str(kept.folder))
    assert done.code == 0
    assert f"{CLAIMS} confirmed" in done.out
    assert done.err == ""
    result = kept.audited(kept.without(kept.middle("command")), tmp_path / "r")
    told = invoke("audit", str(tmp_path / "r"))
    assert told.code == 3
    assert told.errors == [f"Contradiction: {f.line}" for f in result.contradictions]
    assert CONTRADICTED in told.out
    as_json = invoke("audit", str(tmp_path / "r"), "--json")
    assert as_json.code == 3
    assert json.loads(as_json.out) == as_data(result)


def test_a_run_without_messages_says_how_to_keep_them(kept, tmp_path):
    shutil.copytree(kept.folder, tmp_path / "r")
    (tmp_path / "r" / "messages.parquet").unlink()
    done = invoke("audit", str(tmp_path / "r"))
    assert done.code == 1
    path = Path(tmp_path / "r" / "messages.parquet")
    assert done.errors == [f"Error: {path}: no such file; run again with --keep-messages"]


def test_messages_need_a_folder():
    done = invoke("run", "paper", "--horizon", "10", "--keep-messages")
    assert done.code == 1
    assert done.errors == [
        "Error: --keep-messages: there is no folder to keep them in; give --out DIR"
    ]
