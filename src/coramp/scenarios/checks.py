"""What must fit together in a scenario whose values are sensible each by itself."""

import math
from typing import TYPE_CHECKING

from coramp.equations.gaps import least_acceleration_mps2
from coramp.equations.ramp_acceleration import lag_m
from coramp.equations.safe_distance import following_clearance_m, merge_clearance_m
from coramp.errors import CorampError
from coramp.scenarios.demand_checks import demand_problems, detector_problems
from coramp.scenarios.vehicle_checks import vehicle_problems
from coramp.scenarios.world_checks import world_problems
from coramp.strategies.parameters import wrong_settings, wrong_together
from coramp.strategies.registry import strategy_named

if TYPE_CHECKING:
    from coramp.scenarios.model import Scenario

SHARES_WITHIN = 1e-6
SHORTEST_EDGE_M = 1.0
"""What SUMO can still build behind the acceleration lane."""


def problems_of(scenario: "Scenario") -> list[str]:
    """Returns a line ``key: what is wrong; what is allowed`` for all that does not fit."""
    problems = [*_speed_problems(scenario), *_place_problems(scenario), *_flow_problems(scenario)]
    problems += [*_clock_problems(scenario), *_strategy_problems(scenario)]
    problems += [*_motion_problems(scenario), *_driver_problems(scenario)]
    problems += [*vehicle_problems(scenario), *world_problems(scenario)]
    problems += [*_lane_problems(scenario), *demand_problems(scenario)]
    problems += detector_problems(scenario)
    return problems or (_planning_problems(scenario) if scenario.has_one_lane else [])


def _speed_problems(scenario: "Scenario") -> list[str]:
    mainline, ramp = scenario.mainline, scenario.ramp
    problems = []
    if scenario.has_one_lane:
        problems += _fast_ramp_problems(scenario)
    for name, stream in (("mainline", mainline), ("ramp", ramp)):
        low, high = stream.entry_speed_mps
        if low > high:
            problems.append(
                f"{name}.entry_speed_mps: [{low:g}, {high:g}] falls; write the lower speed first"
            )
        for key, value in (("speed_mps", stream.speed_mps), ("entry_speed_mps", high)):
            if value > stream.limit_mps:
                problems.append(
                    f"{name}.{key}: {value:g} is above {name}.limit_mps; "
                    f"allowed is up to {stream.limit_mps:g} m/s"
                )
    return problems


def _fast_ramp_problems(scenario: "Scenario") -> list[str]:
    ramp_mps, v0 = scenario.ramp.speed_mps, scenario.mainline.speed_mps
    if ramp_mps < v0:
        return []
    line = f"ramp.speed_mps: {ramp_mps:g} is not below mainline.speed_mps; "
    return [f"{line}the method needs a ramp slower than {v0:g} m/s"]


def problems_of_planning(scenario: "Scenario") -> list[str]:
    """Returns a line for all that keeps a scenario of several lanes from being planned."""
    return _fast_ramp_problems(scenario) or _planning_problems(scenario)


def _motion_problems(scenario: "Scenario") -> list[str]:
    """What every plan uses must be within what the checker lets pass."""
    motion = scenario.motion
    used = ("slow_down_mps2", "speed_up_mps2")
    hardest = max(used, key=lambda key: float(getattr(motion, key)))
    least = float(getattr(motion, hardest))
    if motion.comfort_mps2 >= least:
        return []
    line = f"motion.comfort_mps2: {motion.comfort_mps2:g} is below motion.{hardest}, which all"
    return [f"{line} plans use; allowed is {least:g} to 10 m/s2"]


def _place_problems(scenario: "Scenario") -> list[str]:
    mainline, ramp = scenario.mainline, scenario.ramp
    problems = []
    if mainline.end_m < ramp.acceleration_lane_m + SHORTEST_EDGE_M:
        problems.append(
            f"mainline.end_m: {mainline.end_m:g} is not far enough beyond the acceleration lane; "
            f"allowed is at least {ramp.acceleration_lane_m + SHORTEST_EDGE_M:g} m"
        )
    if not scenario.detector_station_m <= ramp.acceleration_lane_m:
        problems.append(
            f"ramp.detector_station_m: {scenario.detector_station_m:g} is not beside the "
            f"acceleration lane; allowed is up to {ramp.acceleration_lane_m:g} m"
        )
    given_m = ramp.decision_station_m
    if given_m is not None and not ramp.start_m < given_m < scenario.stop_station_m:
        problems.append(
            f"ramp.decision_station_m: {given_m:g} is not on the ramp before the "
            f"stop; allowed is between {ramp.start_m:g} and {scenario.stop_station_m:g} m"
        )
    if scenario.stop_station_m > -scenario.run_up_m:
        problems.append(
            f"ramp.stop_station_m: {scenario.stop_station_m:g} is too near to the nose to reach v0 "
            f"from a stand; allowed is up to {-scenario.run_up_m:g} m"
        )
    return problems


def _lane_problems(scenario: "Scenario") -> list[str]:
    """What is wrong with the shares of the mainline's lanes."""
    mainline = scenario.mainline
    shares, key = mainline.lane_shares, "mainline.lane_shares"
    if shares is None:
        return []
    if len(shares) != mainline.lanes:
        line = f"{key}: there are {len(shares)} for mainline.lanes {mainline.lanes}"
        return [f"{line}; allowed is one a lane, from the one next to the ramp on"]
    if abs(math.fsum(shares) - 1.0) > SHARES_WITHIN:
        return [f"{key}: they sum to {math.fsum(shares):g}; allowed is a sum of 1"]
    return []


def _flow_problems(scenario: "Scenario") -> list[str]:
    if scenario.arrivals:
        return _list_problems(scenario)
    if scenario.demand:
        return []  # its parts are checked each
    problems = []
    shares = (max(scenario.mainline.shares), 1.0)
    streams = (("mainline", scenario.mainline), ("ramp", scenario.ramp))
    for (name, stream), share in zip(streams, shares, strict=True):
        most = 3600.0 / stream.min_headway_s / share
        flows = (("flow_veh_h", stream.flow_veh_h), ("flow_to_veh_h", stream.flow_to_veh_h))
        problems += [
            f"{name}.{key}: {flow:g} cannot arrive with headways of "
            f"{stream.min_headway_s:g} s or more; allowed is below {most:g} veh/h"
            for key, flow in flows
            if flow is not None and flow >= most
        ]
    return problems


def _list_problems(scenario: "Scenario") -> list[str]:
    problems = []
    last_s: dict[tuple[str, int], float] = {}
    late = [k for k, a in enumerate(scenario.arrivals) if a.time_s > scenario.simulation.horizon_s]
    if late:
        first_s = scenario.arrivals[late[0]].time_s
        least_s = math.ceil(max(a.time_s for a in scenario.arrivals))
        problems.append(
            f"simulation.horizon_s: {scenario.simulation.horizon_s:g} is too short for the list: "
            f"{len(late)} of {len(scenario.arrivals)} arrivals lie beyond it, the first "
            f"arrivals.{late[0]} at {first_s:g} s; allowed is at least {least_s} s"
        )
    for number, arrival in enumerate(scenario.arrivals):
        key = f"arrivals.{number}"
        limit = getattr(scenario, arrival.stream).limit_mps
        if arrival.speed_mps > limit:
            problems.append(
                f"{key}.speed_mps: {arrival.speed_mps:g} is above {arrival.stream}.limit_mps; "
                f"allowed is up to {limit:g} m/s"
            )
        own = arrival.stream, arrival.lane
        if arrival.lane >= (scenario.mainline.lanes if arrival.stream == "mainline" else 1):
            lanes = f"mainline.lanes is {scenario.mainline.lanes}, the ramp has one"
            problems.append(f"{key}.lane: there is no lane {arrival.lane} ({lanes}); 0 is first")
        if arrival.time_s <= last_s.get(own, -1.0):
            problems.append(
                f"{key}.time_s: {arrival.time_s:g} does not come after the one before it on the "
                f"{arrival.stream}; allowed is above {last_s[own]:g} s"
            )
        if not is_multiple(arrival.time_s, scenario.control.step_s):
            problems.append(
                f"{key}.time_s: {arrival.time_s:g} is not on the step grid; "
                f"allowed are multiples of {scenario.control.step_s:g} s"
            )
        last_s[own] = arrival.time_s
    return problems


def is_multiple(value: float, unit: float) -> bool:
    """Returns whether ``value`` is a whole multiple of ``unit``, but for rounding."""
    return abs(value / unit - round(value / unit)) < 1e-6


def _clock_problems(scenario: "Scenario") -> list[str]:
    control = scenario.control
    problems = []
    if not is_multiple(control.actuation_delay_s, control.step_s):
        problems.append(
            f"control.actuation_delay_s: {control.actuation_delay_s:g} is not on the control "
            f"clock; allowed are multiples of {control.step_s:g} s"
        )
    if not is_multiple(1000.0 * control.step_s, 1.0):
        problems.append(
            f"control.step_s: {control.step_s:g} is not what SUMO can step; "
            "allowed are whole milliseconds"
        )
    return problems


def _strategy_problems(scenario: "Scenario") -> list[str]:
    problems: list[str] = []
    for name, settings in scenario.strategy.items():
        try:
            found = strategy_named(name)
        except CorampError as error:
            problems += error.messages
            continue
        wrong = wrong_settings(found, settings) or wrong_together(found, settings)
        problems += [f"strategy.{name}.{line}" for line in wrong]
    return problems


def _driver_problems(scenario: "Scenario") -> list[str]:
    """Drivers among automated vehicles must be there; a speed factor must hold its mean.

    And it needs a common speed to be a factor of.
    """
    problems = []
    traffic = scenario.traffic
    wanted = scenario.is_mixed or "drivers" in traffic.model_fields_set
    if wanted and traffic.drivers not in scenario.drivers:
        known = ", ".join(scenario.drivers) or "none: there is no [drivers.NAME] table"
        problems.append(f"traffic.drivers: there is no {traffic.drivers!r}; allowed are {known}")
    for name, drivers in scenario.drivers.items():
        key, factor = f"drivers.{name}.speed_factor", drivers.speed_factor
        if factor is None:
            continue
        if drivers.wish != "free-flow":
            problems.append(
                f"{key}: each wishes the speed that it entered with; "
                f'allowed with drivers.{name}.wish "free-flow" alone'
            )
        if not factor.low <= factor.mean <= factor.high:
            problems.append(
                f"{key}: {factor.mean:g} is not between low and high; "
                f"allowed are low <= mean <= high"
            )
    return problems


def _planning_problems(scenario: "Scenario") -> list[str]:
    """What only shows once all values are sensible by themselves: can a merge be planned at all?"""
    mainline, ramp, motion = scenario.mainline, scenario.ramp, scenario.motion
    v0, ramp_mps = mainline.speed_mps, ramp.speed_mps
    usable_m, lane_m = scenario.last_merge_station_m, ramp.acceleration_lane_m
    key = "ramp.acceleration_lane_m"
    if usable_m <= 0.0:
        need_m = lane_m - usable_m
        return [f"{key}: {lane_m:g} is too short to merge in; allowed is above {need_m:g} m"]
    least = least_acceleration_mps2(v0, ramp_mps, usable_m)
    if least > motion.ramp_acceleration_mps2:
        need_m = least * usable_m / motion.ramp_acceleration_mps2 + lane_m - usable_m
        asked = f"Eq. 22 asks for {least:.2f} m/s2, more than motion.ramp_acceleration_mps2"
        return [f"{key}: {lane_m:g} is too short: {asked}; allowed is above {need_m:.1f} m"]
    found = _free_acceleration_problem(scenario, least)
    problems = [found] if found else []
    first, last = decision_station_range_m(scenario)
    if gaps := _gap_problems(scenario, first, last):
        problems += gaps
    elif first > last:
        problems.append(
            "ramp.decision_station_m: there is none at which all that matter have entered "
            f"({first:.1f} m or later) and it can still stop ({last:.1f} m or earlier); "
            "allowed are an earlier mainline.start_m, a shorter acceleration lane, harder braking"
        )
    elif not first <= scenario.decision_station_m <= last:
        problems.append(
            f"ramp.decision_station_m: at {scenario.decision_station_m:g} m not every vehicle that "
            "matters has entered, or it is too late to stop; "
            f"allowed is {first:.1f} to {last:.1f} m"
        )
    return problems


def _free_acceleration_problem(scenario: "Scenario", least_mps2: float) -> str:
    """What is wrong where the ordinary acceleration does not fit the lane, else nothing.

    Blamed is the acceleration where it was given, else the lane.
    """
    motion, ramp, v0 = scenario.motion, scenario.ramp, scenario.mainline.speed_mps
    free_mps2, most_mps2 = motion.free_acceleration_mps2, motion.ramp_acceleration_mps2
    key = "motion.free_acceleration_mps2"
    allowed = f"{math.ceil(1000.0 * least_mps2) / 1000.0:g} to {most_mps2:g} m/s2"
    if free_mps2 > most_mps2:
        return f"{key}: {free_mps2:g} is above motion.ramp_acceleration_mps2; allowed is {allowed}"
    if free_mps2 >= least_mps2:
        return ""
    usable_m, lane_m = scenario.last_merge_station_m, ramp.acceleration_lane_m
    need_m = least_mps2 * usable_m / free_mps2 + lane_m - usable_m
    way = f"from {ramp.speed_mps:g} to {v0:g} m/s"
    if "free_acceleration_mps2" in motion.model_fields_set:
        return (
            f"{key}: {free_mps2:g} does not get a vehicle {way} within ramp.acceleration_lane_m "
            f"{lane_m:g} (Eq. 22); allowed is {allowed}, or a lane above {need_m:.1f} m"
        )
    return (
        f"ramp.acceleration_lane_m: {lane_m:g} is too short to get {way} with {key} {free_mps2:g}; "
        f"allowed is above {need_m:.1f} m, or {key} of {allowed} (Eq. 22)"
    )


def _gap_problems(scenario: "Scenario", first_m: float, last_m: float) -> list[str]:
    """What is wrong with the gaps, if it is they that leave the decision station too early.

    A vehicle that enters as another is planned must find room behind that one's merge. Where the
    clearance fits there, everyone is served in the end, however long the queue.
    """
    road, safety = scenario.rules().road, scenario.rules().safety
    v0, station_m = road.mainline_speed_mps, road.decision_station_m
    short_m = (first_m - station_m) * v0 / road.ramp_speed_mps
    bare = safety._replace(time_gap_s=0.0, standstill_gap_m=0.0)
    most_clearance_m = merge_clearance_m(road, safety) - short_m
    if short_m <= 0.0 or station_m > last_m or most_clearance_m < merge_clearance_m(road, bare):
        return []
    room_m = most_clearance_m - following_clearance_m(road, bare)
    gaps_m = {"time_gap_s": safety.time_gap_s * v0, "standstill_gap_m": safety.standstill_gap_m}
    larger, smaller = sorted(gaps_m, key=lambda name: -gaps_m[name])
    allowed_m = {larger: max(0.0, room_m - gaps_m[smaller])}
    if gaps_m[smaller] > room_m:
        allowed_m[smaller] = room_m
    return [_too_long(scenario, name, most_m) for name, most_m in allowed_m.items()]


def _too_long(scenario: "Scenario", name: str, most_m: float) -> str:
    unit, most = "m", most_m
    if name == "time_gap_s":
        unit, most = "s", most_m / scenario.mainline.speed_mps
    return (
        f"safety.{name}: {getattr(scenario.safety, name):g} {unit} does not fit on the mainline "
        f"from {scenario.mainline.start_m:g} m to the merge of a vehicle that is planned at "
        f"ramp.decision_station_m; allowed is up to {math.floor(1000.0 * most) / 1000.0:g} {unit}"
    )


def decision_station_range_m(scenario: "Scenario") -> tuple[float, float]:
    """Returns the first and last station (m) at which a ramp vehicle may be planned.

    The first: a mainline vehicle that enters just then must come behind the subject even if this
    merges with the least acceleration. The last: from there it can still stop before the nose.
    """
    rules = scenario.rules_with(math.nan)  # of the station itself nothing here depends
    road, safety, control = rules.road, rules.safety, scenario.control
    v0, ramp_mps = road.mainline_speed_mps, road.ramp_speed_mps
    least = least_acceleration_mps2(v0, ramp_mps, road.last_merge_station_m)
    behind_m = (
        lag_m(v0, ramp_mps, least)
        + scenario.longest_m
        + merge_clearance_m(road, safety)
        + v0 * control.step_s
    )
    first_m = (road.mainline_start_m + behind_m) * ramp_mps / v0
    stop_m = 0.5 * road.ramp_limit_mps**2 / scenario.stop_mps2
    reaction_m = road.ramp_limit_mps * (control.actuation_delay_s + control.step_s)
    return max(first_m, road.ramp_start_m), road.stop_station_m - stop_m - reaction_m
