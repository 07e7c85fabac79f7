"""Audits the folder of a run: feeds its log to a coordinator, and derives its figures anew."""

import math
from pathlib import Path

import numpy as np

from coramp._kernel import FloatArray
from coramp.audit.decisions import (
    check_acknowledgements,
    check_decisions,
    check_records,
    check_requests,
    check_signals,
    steps_between_looks,
)
from coramp.audit.driving import (
    PLAN_ERROR_M,
    check_completeness,
    check_kinematics,
    check_positions,
    check_reports,
    check_trajectories,
    driven_in_sumo,
    off_the_order_at,
    ordered,
)
from coramp.audit.figures import Derived, derive
from coramp.audit.inputs import Inputs, read_inputs
from coramp.audit.kinematics import ROUNDING
from coramp.audit.orders import Motion, Passages, exits_s, passages_of
from coramp.audit.positions import steps_from
from coramp.audit.verdicts import Audit, Check, Finding, finding, judged, unchecked
from coramp.coordination.examination import bounds_of
from coramp.errors import CorampError
from coramp.messages.kinds import COMPARISON, REPORT
from coramp.messages.log_reader import OutOfOrderError
from coramp.strategies.base import is_metered
from coramp.strategies.registry import strategy_named

FIGURES = (
    "safety_violations",
    "min_margin_m",
    "min_margin_equation",
    "min_merge_margin_m",
    "min_ttc_s",
    "max_drac_mps2",
    "max_severity",
    "max_decel_mps2",
    "max_jerk_mps3",
    "hard_brakings_3",
    "hard_brakings_4_5",
    "stops",
    "unserved",
    "plan_error_m",
)
"""The figures of a run that are derived from its log and compared; collisions are judged apart."""
OF_LANES = ("made_way",)
"""Those of a mainline of several lanes."""
COLLISIONS = "collisions"
TOO_SELDOM = "drivers report once a second, and are under no commitment"


def audit(folder: Path) -> Audit:
    """Returns what the log of a run confirms and what it contradicts.

    Raises CorampError for a folder or a log that cannot be read. Where one message alone is out of
    place it is put there: if the log then contradicts, the message was given another time, and that
    is told; if not, the log is refused for its order.
    """
    try:
        return _audited(read_inputs(folder))
    except OutOfOrderError as error:
        if not error.alone:
            raise
        return _with_one_moved(folder, error)


def _with_one_moved(folder: Path, error: OutOfOrderError) -> Audit:
    try:
        inputs = read_inputs(folder, put_in_order=True)
    except CorampError:
        raise error from None
    result = _audited(inputs)
    if result.holds:
        raise error
    row = int(np.flatnonzero(inputs.log.places == error.row)[0])
    text = "its time is not that of the messages around it"
    moved = finding(inputs.log, row, "the order of messages", text)
    order = judged("messages are in order", f"{inputs.log.frame.height} rows", [moved])
    return Audit(folder, (order, *result.checks))


def _audited(inputs: Inputs) -> Audit:
    folder = inputs.folder
    requests = check_requests(inputs)
    if len(inputs.log.strangers):
        return Audit(folder, (requests, _strangers(inputs), unchecked("all else", "see above")))
    coordinates = strategy_named(inputs.run.content["strategy"]).cooperative
    if not (coordinates and inputs.scenario.has_automated):
        return Audit(folder, (requests, *_of_drivers(inputs)))
    decisions, again = check_decisions(inputs)
    motion = ordered(inputs)
    checks = [
        requests,
        decisions,
        check_acknowledgements(inputs),
        check_kinematics(inputs),
        check_reports(inputs, motion),
        check_completeness(inputs, motion),
        _end(inputs, exits_s(motion.first, motion.rows, inputs.scenario.mainline.end_m)),
        *_figures(inputs, motion),
        check_trajectories(inputs, motion),
        *check_records(inputs, again),
    ]
    return Audit(folder, tuple(checks))


def _end(inputs: Inputs, left_s: FloatArray) -> Check:
    """Holds the end of the run to the exits: two steps after the last, or when it is cut off."""
    simulation, log = inputs.scenario.simulation, inputs.log
    due = round((simulation.horizon_s + simulation.drain_s) / inputs.step_s)
    last_s = float(np.max(left_s, initial=0.0))
    if math.isfinite(last_s):
        due = min(due, math.ceil(last_s / inputs.step_s) + 2)
    findings = []
    if due != log.end_step:
        text = f"the run ends at {due * inputs.step_s:.3f} s by the exits of its vehicles"
        findings = [finding(log, log.frame.height - 1, "a commitment", text)]
    return judged("the end of the run", f"{log.end_step * inputs.step_s:.3f} s", findings)


def _strangers(inputs: Inputs) -> Check:
    log = inputs.log
    text = "the vehicle has not asked to enter before: a request is missing"
    findings = [finding(log, int(row), "a commitment", text) for row in log.strangers]
    return judged("messages name known vehicles", f"{log.frame.height} rows", findings)


def _of_drivers(inputs: Inputs) -> list[Check]:
    """What can be confirmed of SUMO's own drivers, and what cannot."""
    commanded = inputs.order_rows
    strategy = strategy_named(inputs.run.content["strategy"])
    checks = check_positions(inputs, steps_between_looks(inputs))
    text = "commands a driver; drivers take no commands"
    findings = [finding(inputs.log, int(row), "a decision", text) for row in commanded]
    checks.append(judged("no vehicle was commanded", "no trajectory in the log", findings))
    checks.append(_end(inputs, inputs.run.vehicles["exit_s"].fill_null(np.inf).to_numpy()))
    if is_metered(strategy):
        checks.insert(0, check_signals(inputs))
    return [*checks, *(unchecked(name, TOO_SELDOM) for name in (COLLISIONS, *FIGURES))]


def _figures(inputs: Inputs, motion: Motion) -> list[Check]:
    """Derives figures, passages and violations, and compares them with the run's."""
    scenario, step_s = inputs.scenario, inputs.step_s
    bounds = bounds_of(scenario.rules())
    vehicles = len(inputs.log.requests)
    passages = passages_of(inputs.orders, motion, vehicles, bounds.zone_end_m, inputs.end_s)
    merge_s = passages.merge_s
    if not inputs.exact:  # a lane change waits for the next step
        merge_s = steps_from(merge_s, step_s) * step_s
    passages = passages._replace(merge_s=np.where(merge_s > inputs.end_s, np.nan, merge_s))
    driven = motion if inputs.exact else driven_in_sumo(inputs)[0]
    derived = derive(
        inputs.askers,
        motion,
        driven,
        passages,
        inputs.end_s,
        bounds,
        scenario.ramp.acceleration_lane_m,
    )
    figures = {**derived.figures, "plan_error_m": _plan_error_m(inputs, motion)}
    error_m = figures["plan_error_m"] or 0.0
    if error_m > PLAN_ERROR_M:  # then the run's figures are those of SUMO's positions at each step
        why = f"SUMO was {error_m:.3f} m off a plan, and the log has not all of its positions"
        checks = [_figure(inputs, "plan_error_m", error_m)]
        others = (name for name in (COLLISIONS, *FIGURES) if name != "plan_error_m")
        checks += [unchecked(name, why) for name in others]
        return [*checks, unchecked("violations.parquet", why), _vehicles(inputs, passages)]
    checks = [_collisions(inputs, derived)]
    checks += [
        _figure(inputs, name, figures[name]) for name in (*FIGURES, *OF_LANES) if name in figures
    ]
    return [*checks, _violations(inputs, derived), _vehicles(inputs, passages)]


def _collisions(inputs: Inputs, derived: Derived) -> Check:
    told = inputs.run.summary.get(COLLISIONS)
    overlap = derived.least_gap_m < -ROUNDING
    if told and overlap:
        return unchecked(COLLISIONS, f"{told} by SUMO's own count; vehicles do overlap")
    findings = []
    if told or told is None:
        text = f"collisions: {told!r} is recorded, but no vehicles overlap"
        findings = [Finding("run.json", text)]
    if not told and overlap:
        overlap_m = -derived.least_gap_m
        text = f"collisions: {told!r} is recorded, but vehicles overlap by {overlap_m:.3f} m"
        findings = [Finding("run.json", text)]
    how = f"{told}; the least gap in a lane is {derived.least_gap_m:.3f} m"
    return judged(COLLISIONS, how, findings)


def _figure(inputs: Inputs, name: str, found: float | None) -> Check:
    told = inputs.run.summary.get(name)
    findings = []
    if not _alike(told, found):
        findings = [Finding("run.json", f"{name}: {told!r} is recorded, {found!r} was derived")]
    how = f"{told:.6g}" if isinstance(told, int | float) else repr(told)
    return judged(name, how, findings)


def _alike(told: object, found: float | None) -> bool:
    if told is None or found is None:
        return told is None and found is None
    if isinstance(told, bool) or not isinstance(told, int | float):
        return False
    return math.isclose(told, found, rel_tol=ROUNDING, abs_tol=ROUNDING)


def _plan_error_m(inputs: Inputs, motion: Motion) -> float | None:
    """Returns how far off its plan a vehicle was where SUMO was asked, 0 without SUMO."""
    log = inputs.log
    if not len(inputs.orders.vehicle):
        return None
    if inputs.exact:
        return 0.0
    rows = log.of_kind(REPORT, COMPARISON)
    time_s, of_s = log.numbers("time_s")[rows], log.numbers("of_s")[rows]
    asked = ~np.isnan(log.numbers("accel_mps2")[rows])
    asked |= (log.frame["kind"].gather(rows) == COMPARISON).to_numpy()
    rows = rows[asked & (of_s == time_s)]
    off = off_the_order_at(log, rows, motion)
    return float(np.nanmax(np.abs(off[:, 0]), initial=0.0))


def _violations(inputs: Inputs, derived: Derived) -> Check:
    table, found = inputs.run.violations, derived.violations
    if table is None:
        return unchecked("violations.parquet", "the run has none")
    names = [inputs.log.vehicle_id(k) for k in range(len(inputs.log.requests))]
    due = sorted((names[int(f)], names[int(r)], m) for _, f, r, m in found.tolist())
    columns = ("front_vehicle_id", "rear_vehicle_id", "margin_m")
    told = sorted(table.select(columns).rows())
    same = len(due) == len(told) and all(
        mine[:2] == theirs[:2] and _alike(mine[2], theirs[2])
        for mine, theirs in zip(told, due, strict=True)
    )
    text = f"{len(told)} are told, {len(due)} others were derived"
    findings = [] if same else [Finding("violations.parquet", text)]
    return judged("violations.parquet", f"{len(told)} pairs", findings)


def _vehicles(inputs: Inputs, passages: Passages) -> Check:
    """Compares when vehicles came, entered and left with ``vehicles.parquet``."""
    table, names = inputs.run.vehicles, "vehicles.parquet"
    numbers = {inputs.log.vehicle_id(k): k for k in range(len(inputs.log.requests))}
    place = [numbers.get(name, -1) for name in table["vehicle_id"].to_list()]
    due: dict[str, FloatArray] = {
        "scheduled_s": inputs.askers.time_s,
        "entry_s": passages.entry_s,
        "exit_s": passages.exit_s,
    }
    findings = []
    for column, derived in due.items():
        told = table[column].fill_null(np.nan).to_numpy()
        for k, number in enumerate(place):
            found = derived[number] if number >= 0 else np.nan
            if not (np.isnan(told[k]) and np.isnan(found)) and not abs(told[k] - found) <= ROUNDING:
                who = table["vehicle_id"][k]
                text = f"{column} of {who} is {told[k]:.6f}, by the log it is {found:.6f}"
                findings.append(Finding(names, text))
    how = f"{table.height} vehicles: scheduled, entry and exit times"
    return judged(names, how, findings)


def as_data(result: Audit) -> dict[str, object]:
    """Returns an audit as plain data."""
    return {
        "kind": "audit",
        "folder": str(result.folder),
        "holds": result.holds,
        "checks": [{"claim": c.claim, "verdict": c.verdict, "how": c.how} for c in result.checks],
        "contradictions": [
            {
                "row": f.row,
                "time_s": f.time_s,
                "vehicle_id": f.vehicle_id,
                "kind": f.kind,
                "contradicts": f.against,
                "text": f.text,
            }
            for f in result.contradictions
        ],
    }
