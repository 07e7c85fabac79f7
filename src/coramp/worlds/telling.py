"""What vehicles tell of themselves: once a second, from the world's own positions."""

from collections.abc import Sequence

import numpy as np

from coramp._kernel import FloatArray, IntArray
from coramp.messages.log import NO_POSITIONS, Positions, report_steps
from coramp.records.outcome import Outcome


def reports_of_pieces(outcome: Outcome, step_s: float, end_step: int) -> Positions:
    """Returns the reports of vehicles that drive their pieces exactly, after their entry."""
    period = report_steps(step_s)
    first, rows = outcome.pieces.first, outcome.pieces.rows
    found = []
    for vehicle, entry_s in enumerate(outcome.passages.entry_s.tolist()):
        own = rows[first[vehicle] : first[vehicle + 1]]
        if len(own) == 0:
            continue
        from_step = round(entry_s / step_s) // period + 1
        steps = np.arange(from_step * period, end_step + 1, period)
        steps = steps[steps * step_s < outcome.until_s[vehicle]]
        now_s = steps * step_s
        piece = own[np.searchsorted(own[:, 0], now_s, side="right") - 1]
        after_s = now_s - piece[:, 0]
        then_mps = piece[:, 2] + piece[:, 3] * after_s
        station_m = piece[:, 1] + 0.5 * (piece[:, 2] + then_mps) * after_s
        found.append((np.full(len(steps), vehicle), steps, station_m, then_mps))
    if not found:
        return NO_POSITIONS
    vehicles, told_steps, stations_m, speeds_mps = (
        np.concatenate(column) for column in zip(*found, strict=True)
    )
    return _positions(vehicles, told_steps, stations_m, speeds_mps, step_s)


def reports_of_samples(
    vehicle: IntArray,
    time_s: FloatArray,
    station_m: FloatArray,
    speed_mps: FloatArray,
    step_s: float,
) -> Positions:
    """Returns the reports among samples, which are by vehicle and time; the first is the entry."""
    steps = np.rint(time_s / step_s).astype(np.int64)
    again = np.append(False, vehicle[1:] == vehicle[:-1])[: len(vehicle)]
    told = again & (steps % report_steps(step_s) == 0)
    return _positions(vehicle[told], steps[told], station_m[told], speed_mps[told], step_s)


def _positions(
    vehicle: IntArray, steps: IntArray, station_m: FloatArray, speed_mps: FloatArray, step_s: float
) -> Positions:
    steps = steps.astype(np.int64)
    return Positions(
        vehicle.astype(np.int64),
        steps,
        np.asarray(steps * step_s, np.float64),
        station_m,
        speed_mps,
        np.full(len(steps), np.nan),
        np.zeros(len(steps), np.bool_),
    )


def together(parts: Sequence[Positions]) -> Positions:
    """Returns several tables of positions as one."""
    return Positions._make(np.concatenate(column) for column in zip(*parts, strict=True))
