"""Whether a fresh coordinator that is told the same commands the same, bit for bit."""

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.audit.inputs import Inputs, orders_of
from coramp.audit.orders import Orders
from coramp.audit.replay import Replayed, replayed, replayed_signals, requests_in
from coramp.audit.verdicts import UNCHECKED, Check, Finding, finding, judged
from coramp.coordination.guard import strategy_to_run
from coramp.demand.arrivals import arrivals_of
from coramp.errors import CorampError
from coramp.messages.kinds import ACKNOWLEDGEMENT, READING, SIGNAL
from coramp.metrics.attempts import attempts_table
from coramp.metrics.frames import decisions_table
from coramp.strategies.base import period_of, steps_of_period
from coramp.strategies.situation import RUNGS, RUNGS_OF_ONE_LANE

DECISION = "a decision"
COUNTS = (
    "refused_plans",
    "interventions",
    "adjusted_vehicles",
    *(f"rung_{rung}" for rung in RUNGS_OF_ONE_LANE),
)


def check_requests(inputs: Inputs) -> Check:
    """Compares the requests with what the scenario draws with the run's seed."""
    drawn = arrivals_of(inputs.scenario, inputs.run.content["seed"])
    told, findings = requests_in(inputs.log), []
    expected = {request.vehicle_id: request for request in drawn}
    for number, request in enumerate(told):
        if request != expected.get(request.vehicle_id):
            row = int(inputs.log.requests[number])
            text = "no such vehicle comes"
            if due := expected.get(request.vehicle_id):
                changed = [
                    f"{field} is {now!r}, drawn is {then!r}"
                    for field, now, then in zip(request._fields, request, due, strict=True)
                    if now != then
                ]
                text = ", ".join(changed)
            findings.append(finding(inputs.log, row, "the scenario's demand", text))
    asked = {request.vehicle_id for request in told}
    findings += [
        Finding("the scenario's demand", f"{name} never asks to enter; it is to come")
        for name, request in expected.items()
        if name not in asked and request.step <= inputs.log.end_step
    ]
    order = [request.vehicle_id for request in drawn if request.vehicle_id in asked]
    for number, (request, due_id) in enumerate(zip(told, order, strict=False)):
        if not findings and request.vehicle_id != due_id:
            row = int(inputs.log.requests[number])
            text = f"comes before that of {due_id}, which is due first"
            findings.append(finding(inputs.log, row, "the scenario's demand", text))
    how = f"{len(told)} requests are those that the scenario draws with its seed"
    return judged("requests to enter and their times", how, findings)


def check_decisions(inputs: Inputs) -> tuple[Check, Replayed]:
    """Feeds the log to a fresh coordinator and compares every command, in order."""
    name = inputs.run.content["strategy"]
    scenario, simulation = inputs.scenario, inputs.scenario.simulation
    last_step = round((simulation.horizon_s + simulation.drain_s) / inputs.step_s)
    strategy = strategy_to_run(name, scenario.strategy.get(name))
    again = replayed(inputs.log, scenario, strategy, last_step)
    numbers = {r.vehicle_id: k for k, r in enumerate(requests_in(inputs.log))}
    due = orders_of(again.commands, numbers, inputs.step_s)
    findings = _differences(inputs, due)
    how = f"{len(due.vehicle)} commands of a fresh coordinator, bit for bit"
    return judged("decisions", how, findings), again


def _differences(inputs: Inputs, due: Orders) -> list[Finding]:
    """Returns the first difference; where only pieces and merges differ, each of them."""
    told, log = inputs.orders, inputs.log
    both = min(len(told.vehicle), len(due.vehicle))
    other = np.zeros(both, np.bool_)
    for mine, theirs in zip(told[:3], due[:3], strict=True):
        other |= mine[:both] != theirs[:both]
    if other.any() or len(told.vehicle) != len(due.vehicle):
        place = int(np.argmax(other)) if other.any() else both
        row = inputs.order_rows[place] if place < len(told.vehicle) else log.frame.height - 1
        text = f"a coordinator given the same messages {_instead(inputs, due, place)} instead"
        return [*_changed(inputs, due, place), finding(log, int(row), DECISION, text)]
    return _changed(inputs, due, both)


def _changed(inputs: Inputs, due: Orders, until: int) -> list[Finding]:
    """Returns the orders before ``until`` whose pieces or merges are not those commanded."""
    told, found = inputs.orders, []
    for k in range(until):
        mine = told.pieces[told.first[k] : told.first[k + 1]]
        theirs = due.pieces[due.first[k] : due.first[k + 1]]
        text = _difference(mine, theirs)
        if not text and told.merge_s[k] != due.merge_s[k]:
            was, now = float(due.merge_s[k]), float(told.merge_s[k])
            text = f"merges at {now!r} s, decided is {was!r} s"
        if not text and told.change_s[k] != due.change_s[k]:
            was, now = float(due.change_s[k]), float(told.change_s[k])
            text = f"changes lanes at {now!r} s, decided is {was!r} s"
        if text:
            found.append(finding(inputs.log, int(inputs.order_rows[k]), DECISION, text))
    return found


def _difference(told: FloatArray, due: FloatArray) -> str:
    if told.shape != due.shape:
        return f"has {len(told)} pieces, decided are {len(due)}"
    if told.tobytes() == due.tobytes():
        return ""
    piece, column = np.argwhere(told.view(np.int64) != due.view(np.int64))[0].tolist()
    what = ("time (s)", "station (m)", "speed (m/s)", "acceleration (m/s2)")[column]
    said, decided = float(told[piece, column]), float(due[piece, column])
    return f"{what} of piece {piece} is {said!r}, decided is {decided!r}"


def _instead(inputs: Inputs, due: Orders, place: int) -> str:
    if place >= len(due.vehicle):
        return "commands nothing"
    who = inputs.log.vehicle_id(int(due.vehicle[place]))
    does = "lets {} enter" if due.enters[place] else "commands {}"
    return f"{does.format(who)} at {due.time_s[place]:.3f} s"


def steps_between_looks(inputs: Inputs) -> int:
    """Returns after how many steps each a strategy for drivers is asked, 0 if it never is."""
    name = inputs.run.content["strategy"]
    period_s = period_of(strategy_to_run(name, inputs.scenario.strategy.get(name)))
    return 0 if period_s is None else steps_of_period(period_s, inputs.step_s)


def check_signals(inputs: Inputs) -> Check:
    """Feeds the readings to a fresh strategy and compares every colour commanded."""
    name, log = inputs.run.content["strategy"], inputs.log
    strategy = strategy_to_run(name, inputs.scenario.strategy.get(name))
    due = replayed_signals(log, inputs.scenario, strategy)
    findings = _readings(inputs, steps_between_looks(inputs))
    rows = log.of_kind(SIGNAL)
    told = list(zip(log.step[rows].tolist(), log.frame["green"].gather(rows), strict=True))
    wanted = [(signal.step, signal.green) for signal in due]
    for k in range(max(len(told), len(wanted))):
        if told[k : k + 1] != wanted[k : k + 1]:
            row = int(rows[k]) if k < len(rows) else log.frame.height - 1
            instead = "nothing more"
            if k < len(wanted):
                colour = "green" if wanted[k][1] else "red"
                instead = f"{colour} at {wanted[k][0] * inputs.step_s:.3f} s"
            text = f"a strategy given the same readings commands {instead} instead"
            findings.append(finding(log, row, DECISION, text))
            break
    return judged("decisions", f"{len(due)} signals of a fresh strategy", findings)


def _readings(inputs: Inputs, period: int) -> list[Finding]:
    """Holds readings of the loops to their period."""
    log = inputs.log
    told = log.of_kind(READING)
    due = np.arange(period, log.end_step + 1, period)
    for k in range(max(len(told), len(due))):
        if k >= len(told) or k >= len(due) or log.step[told[k]] != due[k]:
            row = int(told[k]) if k < len(told) else log.frame.height - 1
            text = "no reading is due any more"
            if k < len(due):
                text = f"the reading of {due[k] * inputs.step_s:.3f} s is due here"
            return [finding(log, row, DECISION, text)]
    return []


def check_acknowledgements(inputs: Inputs) -> Check:
    """Holds acknowledgements to the commands: one each, in the step of the command."""
    log = inputs.log
    rows = log.of_kind(ACKNOWLEDGEMENT)
    of_step = np.rint(log.numbers("of_s")[rows] / inputs.step_s).astype(np.int64)
    open_orders: dict[tuple[int, int], list[int]] = {}
    commanded = zip(log.vehicle[inputs.order_rows], log.step[inputs.order_rows], strict=True)
    for row, key in zip(inputs.order_rows.tolist(), commanded, strict=True):
        open_orders.setdefault(key, []).append(row)
    findings = []
    for row, key in zip(rows.tolist(), zip(log.vehicle[rows], of_step, strict=True), strict=True):
        waiting = open_orders.get(key, [])
        moved = log.step[row] == key[1] and waiting[:1] != [row - 1]
        if not waiting or waiting[0] > row or moved:
            text = "acknowledges what was not commanded just before"
            findings.append(finding(log, row, "a commitment", text))
            continue
        waiting.pop(0)
        if log.step[row] != key[1]:
            text = f"comes after {key[1] * inputs.step_s:.3f} s, when the channel brought it"
            findings.append(finding(log, row, "a commitment", text))
    for row in sorted(row for waiting in open_orders.values() for row in waiting):
        text = "is not acknowledged in its step"
        findings.append(finding(log, row, "a commitment", text))
    how = f"{len(rows)}, one for each command, in its step"
    return judged("acknowledgements", how, findings)


def check_records(inputs: Inputs, again: Replayed) -> list[Check]:
    """Compares ``decisions.parquet`` and the counts of decisions with those of the coordinator."""
    coordinator, findings = again.coordinator, []
    names = [request.vehicle_id for request in requests_in(inputs.log)]
    due = decisions_table(coordinator.decisions, names, coordinator.entered()[0])
    if inputs.run.decisions is None:
        raise CorampError(f"{inputs.folder}: is not complete; run again with the same --out")
    told = inputs.run.decisions
    if not told.equals(due):
        findings.append(Finding("decisions.parquet", _first_other(told, due, "decision")))
    tried = attempts_table(
        coordinator.decisions, coordinator.refusals, names, coordinator.entered()[0]
    )
    served = {rung: set() for rung in RUNGS}  # type: dict[str, set[int]]
    adjusted: set[int] = set()
    for decision in coordinator.decisions:
        served[decision.explanation.rung].add(decision.explanation.row)
        adjusted.update(decision.adjusted_rows)
    counts = dict(
        zip(
            COUNTS,
            (
                len(coordinator.refusals),
                coordinator.interventions,
                len(adjusted),
                *(len(served[rung]) for rung in RUNGS_OF_ONE_LANE),
            ),
            strict=True,
        )
    )
    summary = inputs.run.summary
    wrong = [
        Finding("run.json", f"{name}: {summary.get(name)!r} is recorded, {count} were found")
        for name, count in counts.items()
        if summary.get(name) != count
    ]
    return [
        judged("decisions.parquet", f"{due.height} explained decisions", findings),
        *_check_attempts(inputs.run.attempts, tried),
        judged("counts of refusals, rungs and adjusted vehicles", "of a fresh coordinator", wrong),
    ]


def _check_attempts(told: pl.DataFrame | None, due: pl.DataFrame) -> list[Check]:
    """Compares what was tried; it says so where the folder does not tell."""
    if told is None:
        return [Check("attempts.parquet", UNCHECKED, "is missing, as in runs of an older coramp")]
    findings = []
    if not told.equals(due):
        findings.append(Finding("attempts.parquet", _first_other(told, due, "attempt")))
    return [judged("attempts.parquet", f"{due.height} attempts of these decisions", findings)]


def _first_other(told: pl.DataFrame, due: pl.DataFrame, what: str) -> str:
    if told.schema != due.schema or told.height != due.height:
        return f"there are {due.height} {what}s; the file has {told.height}"
    for k in range(due.height):
        if not told[k].equals(due[k]):
            row = due.row(k, named=True)
            return f"the {what} about {row['vehicle_id']} at {row['time_s']:.3f} s is another"
    return "columns are others"
