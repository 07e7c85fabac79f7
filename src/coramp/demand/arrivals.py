"""Who arrives when: random headways and entry speeds, the same for every strategy."""

import math
from collections.abc import Sequence
from itertools import count
from operator import itemgetter

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.coordination.plant import Arrival
from coramp.demand.generators import generator
from coramp.demand.measured import drawn_arrivals
from coramp.road.streams import STREAMS
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import Mainline, Ramp, Vehicle
from coramp.scenarios.vehicle_types import VehicleType
from coramp.vehicles.traits import CAR, Traits


def arrival_times_s(
    flow_veh_h: float,
    min_headway_s: float,
    horizon_s: float,
    step_s: float,
    random: np.random.Generator,
) -> FloatArray:
    """Returns times (s) on the step grid within [0, horizon), headways shifted exponential.

    A headway is ``min_headway`` plus an exponential one whose mean makes up the flow. Times are
    rounded up to the grid, so headways keep their minimum if that is a multiple of the step.
    """
    if flow_veh_h == 0.0:
        return np.empty(0)
    mean_extra_s = 3600.0 / flow_veh_h - min_headway_s
    expected = int(flow_veh_h * horizon_s / 3600.0)
    times_s = np.empty(0)
    last_s = 0.0
    while last_s < horizon_s:
        headways_s = min_headway_s + random.exponential(mean_extra_s, expected // 4 + 64)
        times_s = np.concatenate([times_s, last_s + np.cumsum(headways_s)])
        last_s = times_s[-1]
    steps = np.ceil(times_s / step_s - 1e-9)
    return np.asarray(steps[steps * step_s < horizon_s - 1e-9] * step_s)


def changing_arrival_times_s(
    flows_veh_h: tuple[float, float],
    min_headway_s: float,
    horizon_s: float,
    step_s: float,
    random: np.random.Generator,
) -> FloatArray:
    """Returns times (s) as ``arrival_times_s`` does, of a flow that changes evenly.

    It goes from the first of ``flows_veh_h`` at 0 to the second at the horizon. Once the least
    headway h has passed, the chance of an arrival is lambda = 1 / (3600 / q - h) in each second, q
    being the flow of that moment: with a constant q these are the headways of ``arrival_times_s``.
    A draw e of the unit exponential distribution is the integral of lambda up to the arrival.
    """
    at_s = np.arange(math.ceil(horizon_s / step_s) + 2) * step_s
    middle = np.minimum(1.0, (at_s[:-1] + 0.5 * step_s) / horizon_s)
    flow_veh_h = flows_veh_h[0] + (flows_veh_h[1] - flows_veh_h[0]) * middle
    rate_ps = flow_veh_h / (3600.0 - flow_veh_h * min_headway_s)
    integral = np.concatenate([[0.0], np.cumsum(rate_ps * step_s)])
    times_s = []
    last_s = 0.0
    while last_s + min_headway_s < at_s[-1]:
        due = np.interp(last_s + min_headway_s, at_s, integral) + random.exponential()
        if due >= integral[-1]:
            break
        last_s = float(np.interp(due, integral, at_s))
        times_s.append(last_s)
    steps = np.ceil(np.array(times_s) / step_s - 1e-9)
    return np.asarray(steps[steps * step_s < horizon_s - 1e-9] * step_s)


def arrivals_of(scenario: Scenario, seed: int) -> list[Arrival]:
    """Returns all arrivals of a run, by time, the mainline's first where two coincide.

    Vehicles are named by scheduled time: m00001, r00001 and so on.
    """
    if scenario.arrivals:
        given = _explicit_arrivals(scenario)
    elif scenario.demand:
        given = [
            *_measured_arrivals(scenario, False, seed),
            *_measured_arrivals(scenario, True, seed),
        ]
    else:
        given = [
            *_mainline_arrivals(scenario, seed),
            *_stream_arrivals(scenario, True, scenario.ramp, seed),
        ]
    numbers = (count(1), count(1))
    given.sort(key=IN_ORDER)
    return [
        Arrival(
            f"{'mr'[on_ramp]}{next(numbers[on_ramp]):05d}",
            on_ramp,
            step,
            mps,
            length_m,
            kind,
            traits,
            lane,
        )
        for step, on_ramp, mps, length_m, kind, traits, lane in given
    ]


Unnamed = tuple[int, bool, float, float, str, Traits | None, int]
"""An arrival without its name: step, by the ramp or not, speed (m/s), length (m), type, traits,
lane."""
IN_ORDER = itemgetter(0, 1, 2, 3)
"""By time, the mainline first; then by speed and length, where a stream has two at once."""


def _explicit_arrivals(scenario: Scenario) -> list[Unnamed]:
    found = []
    for arrival in scenario.arrivals:
        kind = scenario.type_named(arrival.type)
        top_mps = arrival.top_speed_mps or 0.5 * sum(kind.top_speeds_mps)
        step = round(arrival.time_s / scenario.control.step_s)
        rest = _rest(scenario, kind, arrival.speed_mps, top_mps, arrival.length_m)
        found.append((step, arrival.stream == "ramp", *rest, arrival.lane))
    return found


def _measured_arrivals(scenario: Scenario, on_ramp: bool, seed: int) -> list[Unnamed]:
    return [
        (one.step, on_ramp, *_rest(scenario, one.kind, one.speed_mps, one.top_mps), one.lane)
        for one in drawn_arrivals(scenario, on_ramp, seed)
    ]


def _rest(
    scenario: Scenario,
    kind: VehicleType,
    speed_mps: float,
    top_mps: float,
    length_m: float | None = None,
) -> tuple[float, float, str, Traits | None]:
    """Returns an arrival of a type; nobody enters faster than it can drive."""
    length_m = kind.length_m if length_m is None else length_m
    traits = None
    if not isinstance(scenario.vehicle, Vehicle) or not math.isinf(top_mps):
        own = kind.traits(scenario.usual_traits(length_m), top_mps)
        traits = own._replace(length_m=length_m)
    return min(speed_mps, top_mps), length_m, kind.name, traits


def _mainline_arrivals(scenario: Scenario, seed: int) -> list[Unnamed]:
    """The arrivals of each lane, with the least headway in the lane; each has draws of its own."""
    mainline, found = scenario.mainline, []
    for lane, share in enumerate(mainline.shares):
        to_veh_h = mainline.flow_to_veh_h
        flows = {
            "flow_veh_h": share * mainline.flow_veh_h,
            "flow_to_veh_h": None if to_veh_h is None else share * to_veh_h,
        }
        own = mainline.model_copy(update=flows)
        found += _stream_arrivals(scenario, False, own, seed, lane)
    return found


def _stream_arrivals(
    scenario: Scenario, on_ramp: bool, stream: Mainline | Ramp, seed: int, lane: int = 0
) -> list[Unnamed]:
    name, step_s = STREAMS[on_ramp], scenario.control.step_s
    of_lane = f"{name}/lane {lane}" if lane > 0 else name
    clock = stream.min_headway_s, scenario.simulation.horizon_s, step_s
    random = generator(seed, f"arrivals/{of_lane}")
    if stream.flow_to_veh_h is None:
        times_s = arrival_times_s(stream.flow_veh_h, *clock, random)
    else:
        flows_veh_h = stream.flow_veh_h, stream.flow_to_veh_h
        times_s = changing_arrival_times_s(flows_veh_h, *clock, random)
    low_mps, high_mps = stream.entry_speed_mps
    speeds_mps = generator(seed, f"entry speeds/{of_lane}").uniform(low_mps, high_mps, len(times_s))
    steps = np.rint(times_s / step_s).astype(np.int64)
    if isinstance(scenario.vehicle, Vehicle):
        length_m = scenario.vehicle.length_m
        return [
            (step, on_ramp, speed_mps, length_m, CAR, None, lane)
            for step, speed_mps in zip(steps.tolist(), speeds_mps.tolist(), strict=True)
        ]
    kinds = kinds_of(scenario, on_ramp, len(times_s), seed, of_lane)
    return [
        (step, on_ramp, *_rest(scenario, kind, speed_mps, top_mps), lane)
        for step, speed_mps, (kind, top_mps) in zip(
            steps.tolist(), speeds_mps.tolist(), kinds, strict=True
        )
    ]


def kinds_of(
    scenario: Scenario, on_ramp: bool, count: int, seed: int, of_lane: str | None = None
) -> list[tuple[VehicleType, float]]:
    """Returns type and top speed (m/s) of each vehicle of a stream, drawn by the types' shares.

    ``of_lane`` names the draws of a lane other than the outermost.

    A vehicle keeps its draws whatever else changes, so that a truck at a share of 10 % is one at
    20 % as well where trucks come last in the list of types.
    """
    types, name = scenario.vehicle_types, of_lane or STREAMS[on_ramp]
    if len(types) == 1 and math.isinf(types[0].top_speeds_mps[1]):
        return [(types[0], math.inf)] * count
    up_to = np.cumsum([kind.share_of(on_ramp) for kind in types])
    draws = generator(seed, f"vehicle types/{name}").random(count)
    places = np.minimum(np.searchsorted(up_to, draws, side="right"), len(types) - 1)
    shares = generator(seed, f"top speeds/{name}").random(count)
    kinds = []
    for place, share in zip(places.tolist(), shares.tolist(), strict=True):
        low_mps, high_mps = types[place].top_speeds_mps
        top_mps = high_mps if math.isinf(high_mps) else low_mps + share * (high_mps - low_mps)
        kinds.append((types[place], top_mps))
    return kinds


def automated_of(scenario: Scenario, arrivals: Sequence[Arrival], seed: int) -> BoolArray:
    """Returns which arrivals are automated vehicles, one entry each.

    Each stream has random numbers of its own, one a vehicle in the order of arrival, which do not
    depend on the share: who is automated at one share is so at every higher one.
    """
    share = [scenario.automated_share_of(a.vehicle_type, a.on_ramp) for a in arrivals]
    return _draws(arrivals, seed, "traffic/automated") < np.array(share)


def connected_of(scenario: Scenario, arrivals: Sequence[Arrival], seed: int) -> BoolArray:
    """Returns which arrivals tell where they are if they are drivers, drawn as in automated_of."""
    return _draws(arrivals, seed, "traffic/connected") < scenario.traffic.connected_share


def _draws(arrivals: Sequence[Arrival], seed: int, purpose: str) -> FloatArray:
    draws = np.empty(len(arrivals))
    on_ramp = np.array([arrival.on_ramp for arrival in arrivals], np.bool_)
    for ramp, stream in enumerate(STREAMS):
        own = on_ramp == bool(ramp)
        draws[own] = generator(seed, f"{purpose}/{stream}").random(int(own.sum()))
    return draws
