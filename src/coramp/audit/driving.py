"""Whether what was commanded can be driven, and whether vehicles were where they had to be."""

import numpy as np
import polars as pl

from coramp._kernel import FloatArray, IntArray
from coramp.audit.inputs import Inputs
from coramp.audit.kinematics import FINE, REASONS, ROUNDING, Road, faults_of
from coramp.audit.orders import Motion, motion_of
from coramp.audit.positions import due_reports, expected_in_sumo, off_the_order
from coramp.audit.verdicts import Check, Finding, finding, judged
from coramp.coordination.examination import bounds_of
from coramp.messages.kinds import COMPARISON, REPORT
from coramp.messages.log import report_steps
from coramp.messages.log_reader import MessageLog

COMMITMENT = "a commitment"
PLAN_ERROR_M = 0.05
"""So far off its plan may a vehicle be in SUMO."""
DEVIATIONS = 5.0
SAMPLED_M = 0.06
"""Positions of drivers are kept within 5 cm, and SUMO writes four decimals."""


def check_kinematics(inputs: Inputs) -> Check:
    """Holds each command to what was committed before, and to the vehicle's limits."""
    scenario = inputs.scenario
    road = Road(
        scenario.mainline.start_m, scenario.ramp.start_m, scenario.control.actuation_delay_s
    )
    faults = faults_of(inputs.orders, inputs.askers, road, bounds_of(scenario.rules()))
    findings = [
        finding(
            inputs.log,
            int(inputs.order_rows[k]),
            "kinematics",
            REASONS[faults.code[k]].format(given=faults.given[k], due=faults.due[k]),
        )
        for k in np.flatnonzero(faults.code != FINE).tolist()
    ]
    how = f"{len(faults.code)} commands: continuous in time, station and speed; limits kept"
    return judged("kinematics of commands", how, findings)


def off_the_order_at(log: MessageLog, rows: IntArray, motion: Motion) -> FloatArray:
    """Returns how far (m) and how much faster (m/s) each position told is than ordered, (n, 2)."""
    columns = ("time_s", "station_m", "speed_mps")
    return off_the_order(motion, log.vehicle[rows], *(log.numbers(name)[rows] for name in columns))


def check_reports(inputs: Inputs, motion: Motion) -> Check:
    """Holds every position that was told to the commitment in force."""
    log = inputs.log
    rows = log.of_kind(REPORT, COMPARISON)
    off = off_the_order_at(log, rows, motion)
    std_m = log.numbers("std_m")[rows]
    exactly_m = ROUNDING if inputs.exact else PLAN_ERROR_M + ROUNDING
    allowed_m = np.where(std_m > 0.0, DEVIATIONS * std_m, exactly_m)
    wrong = ~(np.abs(off[:, 0]) <= allowed_m)
    if inputs.exact:
        wrong |= (std_m == 0.0) & ~(np.abs(off[:, 1]) <= ROUNDING)
    findings = [
        finding(log, int(rows[k]), COMMITMENT, _told_off(off[k], float(allowed_m[k])))
        for k in np.flatnonzero(wrong).tolist()
    ]
    how = f"{len(rows)} positions within {1e3 * exactly_m:g} mm of the commitment in force"
    return judged("reports", how, findings)


def _told_off(off: FloatArray, allowed_m: float) -> str:
    if np.isnan(off[0]):
        return "comes before the vehicle has entered"
    return (
        f"is {off[0]:+.6f} m and {off[1]:+.6f} m/s off the commitment in force; "
        f"allowed are {allowed_m:g} m"
    )


def check_completeness(inputs: Inputs, motion: Motion, looks: int = 0) -> Check:
    """Looks for reports that are missing, told twice, or not due.

    ``looks`` is after how many steps each a strategy may have asked for reports, of the step
    before; 0 if it never does.
    """
    log, end_m, period = inputs.log, inputs.scenario.mainline.end_m, report_steps(inputs.step_s)
    reports = log.of_kind(REPORT)
    obeying = ~np.isnan(log.numbers("accel_mps2")[reports])
    due = due_reports(motion, end_m, inputs.step_s, period, log.end_step)
    findings = _unmatched(inputs, reports[~obeying], due, "report", looks)
    told = len(reports) - int(obeying.sum())
    if len(inputs.orders.vehicle) and not inputs.exact:
        compared = log.of_kind(COMPARISON)
        begun, expected = expected_in_sumo(inputs.orders, end_m, inputs.step_s, log.end_step)
        findings += _unmatched(inputs, compared, expected, "comparison")
        findings += _missing(inputs, reports[obeying], begun, "report on obeying")
        findings += [*_not_driven_on(inputs), *_told_twice(inputs, reports[obeying])]
        told += len(compared)
    how = f"{told} reports: one per second for each vehicle on the road"
    return judged("reports are complete", how, sorted(findings, key=lambda f: f.row or 0))


def _unmatched(
    inputs: Inputs, rows: IntArray, due: IntArray, what: str, looks: int = 0
) -> list[Finding]:
    log = inputs.log
    findings = [*_missing(inputs, rows, due, what), *_told_twice(inputs, rows)]
    if what == "report":
        odd = log.step[rows] % report_steps(inputs.step_s) != 0
        if looks:
            odd &= (log.step[rows] + 1) % looks != 0
        findings += [
            finding(log, int(row), COMMITMENT, "is not due: reports come each whole second")
            for row in rows[odd].tolist()
        ]
    return findings


def _missing(inputs: Inputs, rows: IntArray, due: IntArray, what: str) -> list[Finding]:
    log = inputs.log
    told_keys = _keys(log.vehicle[rows], log.step[rows], log.end_step)
    due_keys = _keys(due[:, 0], due[:, 1], log.end_step)
    findings = []
    for k in np.flatnonzero(~np.isin(due_keys, told_keys)).tolist():
        vehicle, step = due[k].tolist()
        after = min(int(np.searchsorted(log.step, step, side="right")), log.frame.height - 1)
        who, when_s = log.vehicle_id(vehicle), step * inputs.step_s
        text = f"before it the {what} of {who} at {when_s:.3f} s is missing"
        findings.append(finding(log, after, COMMITMENT, text))
    return findings


def _told_twice(inputs: Inputs, rows: IntArray) -> list[Finding]:
    """Returns positions that a vehicle tells again: of one time, and at one time."""
    log = inputs.log
    keys = np.column_stack([log.vehicle[rows], log.step[rows], log.numbers("of_s")[rows]])
    _, first = np.unique(keys, axis=0, return_index=True)
    return [
        finding(log, int(rows[k]), COMMITMENT, "is reported twice")
        for k in np.setdiff1d(np.arange(len(rows)), first).tolist()
    ]


def _keys(vehicle: IntArray, step: IntArray, end_step: int) -> IntArray:
    return np.asarray(vehicle * (end_step + 1) + step)


def driven_in_sumo(inputs: Inputs) -> tuple[Motion, IntArray]:
    """Returns what vehicles drove by their reports with an acceleration, and those reports' rows.

    They come by vehicle, and for each in the order of the log.
    """
    log = inputs.log
    rows = log.of_kind(REPORT)
    rows = rows[~np.isnan(log.numbers("accel_mps2")[rows])]
    rows = rows[np.argsort(log.vehicle[rows], kind="stable")]
    columns = ("time_s", "station_m", "speed_mps", "accel_mps2")
    pieces = np.column_stack([log.numbers(name)[rows] for name in columns])
    first = np.searchsorted(log.vehicle[rows], np.arange(len(log.requests) + 1)).astype(np.int64)
    return Motion(first, np.ascontiguousarray(pieces)), rows


DRIVEN_ON_M = 3e-3
"""So far SUMO may be off what a vehicle's reports lead to: two nodes of 1 mm, and rounding."""
DRIVEN_ON_MPS = 1e-6


def _not_driven_on(inputs: Inputs) -> list[Finding]:
    """Returns positions that the reports before do not lead to: one of them is wrong, or missing.

    A report with an acceleration says how its vehicle drives on until the next such report.
    """
    log, (motion, obeying) = inputs.log, driven_in_sumo(inputs)
    pieces, vehicle = motion.rows, log.vehicle[obeying]
    after_s = pieces[1:, 0] - pieces[:-1, 0]
    mean_mps = pieces[:-1, 2] + 0.5 * pieces[:-1, 3] * after_s
    off_m = pieces[1:, 1] - pieces[:-1, 1] - mean_mps * after_s
    odd = (vehicle[1:] == vehicle[:-1]) & ~(np.abs(off_m) <= DRIVEN_ON_M)
    found = list(zip(obeying[1:][odd].tolist(), off_m[odd].tolist(), strict=True))
    rows = np.setdiff1d(log.of_kind(REPORT, COMPARISON), obeying)
    off = off_the_order_at(log, rows, motion)
    exactly = log.numbers("std_m")[rows] == 0.0
    wrong = exactly & ~(np.abs(off) <= (DRIVEN_ON_M, DRIVEN_ON_MPS)).all(axis=1)
    found += zip(rows[wrong].tolist(), off[wrong, 0].tolist(), strict=True)
    text = "is {:+.6f} m off, or not as fast as, what the vehicle's reports before it lead to"
    return [finding(log, row, COMMITMENT, text.format(metres)) for row, metres in sorted(found)]


def check_trajectories(inputs: Inputs, motion: Motion) -> Check:
    """Compares ``trajectories.parquet`` with the commitments."""
    table = inputs.run.trajectories
    if table is None:
        missing = Finding("the run's folder", "trajectories.parquet is missing")
        return judged("trajectories.parquet", "", [missing])
    number = {inputs.log.vehicle_id(k): k for k in range(len(inputs.log.requests))}
    vehicle = table["vehicle_id"].replace_strict(number, default=-1, return_dtype=pl.Int64)
    known = (vehicle >= 0).to_numpy()
    columns = ("time_s", "station_m", "speed_mps")
    off = off_the_order(
        motion,
        np.where(known, vehicle.to_numpy(), 0),
        *(table[name].fill_null(np.nan).to_numpy() for name in columns),
    )
    wrong = ~known | ~(np.abs(off) <= ROUNDING).all(axis=1)
    findings = [
        Finding(
            "trajectories.parquet",
            f"its row {k} is {off[k, 0]:+.6f} m off the commitment in force",
        )
        for k in np.flatnonzero(wrong).tolist()
    ]
    driven = set(vehicle.unique().to_list())
    findings += [
        Finding("trajectories.parquet", f"it has nothing of {inputs.log.vehicle_id(k)}")
        for k in np.unique(inputs.orders.vehicle).tolist()
        if k not in driven
    ]
    return judged("trajectories.parquet", f"{table.height} pieces are those commanded", findings)


def check_positions(inputs: Inputs, looks: int) -> list[Check]:
    """Compares the reports of drivers with ``positions.parquet``, and looks for missing ones.

    ``looks`` is that of ``check_completeness``.
    """
    log, table = inputs.log, inputs.run.positions
    if table is None:
        missing = Finding("the run's folder", "positions.parquet is missing")
        return [judged("reports", "", [missing])]
    number = {log.vehicle_id(k): k for k in range(len(log.requests))}
    table = table.with_columns(number=pl.col("vehicle_id").replace_strict(number, default=-1))
    table = table.filter(pl.col("number") >= 0).sort("number", "time_s", maintain_order=True)
    vehicle = table["number"].to_numpy()
    columns = ("time_s", "station_m", "speed_mps", "accel_mps2")
    rows = np.column_stack([table[name].fill_null(np.nan).to_numpy() for name in columns])
    first = np.searchsorted(vehicle, np.arange(len(log.requests) + 1)).astype(np.int64)
    reports = log.of_kind(REPORT)
    motion = Motion(first, np.ascontiguousarray(rows))
    off = off_the_order_at(log, reports, motion)
    findings = [
        finding(log, int(reports[k]), "positions.parquet", f"is {off[k, 0]:+.3f} m off it")
        for k in np.flatnonzero(~(np.abs(off[:, 0]) <= SAMPLED_M)).tolist()
    ]
    how = f"{len(reports)} reports within {SAMPLED_M:g} m of positions.parquet"
    return [judged("reports", how, findings), check_completeness(inputs, motion, looks)]


def ordered(inputs: Inputs) -> Motion:
    """Returns what the commands have the vehicles drive."""
    return motion_of(inputs.orders, len(inputs.log.requests))
