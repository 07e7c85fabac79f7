"""Random traffic for properties, and the loop run over it without any simulator."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.driven import driven_pieces
from coramp.coordination.plant import Arrival
from coramp.errors import CorampError
from coramp.messages.feed import RequestFeed
from coramp.road.lanes import MAINLINE
from coramp.scenarios.loading import load_scenario
from coramp.strategies.registry import strategies, strategy_named

STEP_S = 0.1
SAMPLE_S = 0.05
COOPERATIVE = [name for name, s in strategies().items() if s.cooperative]

OVERRIDES = {
    "safety.time_gap_s": [0.0, 0.0, 0.6, 1.4],
    "safety.standstill_gap_m": [0.0, 0.0, 2.5],
    "safety.positioning_error_m": [0.02, 0.5],
    "safety.clock_error_s": [3e-9, 0.01],
    "safety.adhesion": [0.4, 0.1],
    "ramp.acceleration_lane_m": [200.0, 120.0],
    "ramp.decision_station_m": [-200.0, -280.0, -60.0],
    "control.gap_position": ["nearest", "front"],
    "control.gap_creation_start": ["decision", "nose"],
    "control.actuation_delay_s": [0.1, 0.5, 0.0],
    "motion.speed_deviation": [0.1, 0.0],
}


@st.composite
def scenarios(draw):
    """A valid variant of a built-in scenario."""
    chosen = {key: draw(st.sampled_from(values)) for key, values in OVERRIDES.items()}
    try:
        return load_scenario(draw(st.sampled_from(["paper", "expressway"])), chosen)
    except CorampError:
        return load_scenario("paper")


def _stream(draw, road, on_ramp, most):
    low, high = road.entry_speed_mps
    gaps = draw(st.lists(st.integers(6, 50), min_size=1, max_size=most))
    return [
        Arrival("", on_ramp, step, draw(st.floats(low, high)), draw(st.sampled_from([5.0, 12.0])))
        for step in np.cumsum(gaps).tolist()
    ]


@st.composite
def traffic(draw, scenario):
    """Arrivals on both streams, dense enough that nearly everyone meets somebody."""
    arrivals = _stream(draw, scenario.mainline, False, 30) + _stream(draw, scenario.ramp, True, 15)
    return named(arrivals)


def named(arrivals):
    """Arrivals by time, named as a run names them."""
    numbers, result = [0, 0], []
    for a in sorted(arrivals, key=lambda a: (a.step, a.on_ramp)):
        numbers[a.on_ramp] += 1
        name = f"{'r' if a.on_ramp else 'm'}{numbers[a.on_ramp]:05d}"
        result.append(a._replace(vehicle_id=name))
    return result


@st.composite
def lane_traffic(draw):
    """A valid road of several lanes, with vehicles on each of them and on the ramp."""
    names = ("safety.time_gap_s", "control.actuation_delay_s", "control.gap_position")
    chosen = {key: draw(st.sampled_from(OVERRIDES[key])) for key in names}
    lanes = draw(st.integers(2, 4))
    scenario = load_scenario("paper", {**chosen, "mainline.lanes": lanes})
    arrivals = []
    for lane in (*range(lanes), None):
        low, high = (scenario.ramp if lane is None else scenario.mainline).entry_speed_mps
        gaps = draw(st.lists(st.integers(8, 60), min_size=1, max_size=12))
        arrivals += [
            Arrival("", lane is None, step, draw(st.floats(low, high)), 5.0, lane=lane or 0)
            for step in np.cumsum(gaps).tolist()
        ]
    return scenario, named(arrivals)


@st.composite
def situations(draw, names=tuple(COOPERATIVE)):
    """A scenario with traffic, and a cooperative strategy, of those named."""
    scenario = draw(scenarios())
    return scenario, draw(traffic(scenario)), draw(st.sampled_from(names))


def loop(scenario, arrivals, strategy, last_s=400.0):
    """Returns the coordinator after it has handled everyone; ``strategy`` may be an object."""
    if isinstance(strategy, str):
        strategy = strategy_named(strategy)()
    coordinator = Coordinator(
        strategy, scenario.rules(), RequestFeed(arrivals), scenario.fastest_mainline_entry_mps
    )
    coordinator.expect_arrivals()
    coordinator.run(round(last_s / STEP_S))
    return coordinator


@dataclass(frozen=True)
class Driven:
    """What one vehicle drove: pieces, lane codes, and when it was gone."""

    pieces: np.ndarray
    lanes: np.ndarray
    until_s: float
    length_m: float


def driven(coordinator, arrivals, end_s=400.0):
    """Returns what everyone drove, by the row in which he entered."""
    of_row, _ = coordinator.entered()
    rows = np.arange(len(of_row))
    first, lanes, pieces = driven_pieces(coordinator.ledger, rows, len(rows), end_s)
    return [
        Driven(
            pieces[first[k] : first[k + 1]],
            lanes[first[k] : first[k + 1]],
            min(end_s, coordinator.ledger.exit_time_s(k)),
            arrivals[of_row[k]].length_m,
        )
        for k in rows
    ]


def states(vehicle, times_s):
    """Station, speed and lane by plain evaluation of the pieces; nan where it is not there."""
    starts = vehicle.pieces[:, 0]
    k = np.clip(np.searchsorted(starts, times_s, side="right") - 1, 0, None)
    x = times_s - starts[k]
    station = vehicle.pieces[k, 1] + vehicle.pieces[k, 2] * x + vehicle.pieces[k, 3] * x * x / 2
    speed = vehicle.pieces[k, 2] + vehicle.pieces[k, 3] * x
    there = (times_s >= starts[0]) & (times_s < vehicle.until_s)
    return np.where(there, station, np.nan), speed, vehicle.lanes[k] == MAINLINE


def eq_1(front_mps, rear_mps, safety):
    closing = 3.6 * np.maximum(0.0, rear_mps - front_mps)
    return (
        2 * safety.positioning_error_m
        + safety.clock_error_s * (front_mps + rear_mps)
        + closing**2 / (254 * (safety.adhesion + safety.resistance))
        + safety.time_gap_s * rear_mps
        + safety.standstill_gap_m
    )


def least_margin_m(vehicles, safety):
    """The least distance beyond Eq. 1 of any two that share a lane, by dense sampling."""
    vehicles = [vehicle for vehicle in vehicles if len(vehicle.pieces)]
    times_s = np.arange(0.0, max(v.pieces[-1, 0] for v in vehicles) + 10.0, SAMPLE_S)
    sampled = [states(v, times_s) for v in vehicles]
    station = np.array([s[0] for s in sampled])
    speed = np.array([s[1] for s in sampled])
    on_mainline = np.array([s[2] for s in sampled])
    least_m = np.inf
    for i, vehicle in enumerate(vehicles):
        behind = (on_mainline == on_mainline[i]) & (station <= station[i])
        behind[i] = False
        margin = station[i] - vehicle.length_m - station - eq_1(speed[i], speed, safety)
        least_m = min(least_m, float(margin[behind].min(initial=np.inf)))
    return least_m
