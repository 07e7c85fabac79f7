"""What a run was asked: its road, its traffic, its world, as a table of a page."""

from pathlib import Path

from coramp.records.run import RunRecords
from coramp.records.world_told import told_of_world
from coramp.road.streams import STREAMS
from coramp.scenarios.demand_sections import peak_veh_h
from coramp.scenarios.model import Scenario
from coramp.scenarios.world_sections import TABLES
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.tables import Table


def asked_table(run: RunRecords, unit: SpeedUnit = MPS) -> Table:
    """Returns the road, traffic and error budget that were asked about; speeds in a unit."""
    scenario = run.scenario
    mainline, ramp, safety = scenario.mainline, scenario.ramp, scenario.safety
    stations = f"{mainline.start_m:g} to {mainline.end_m:g} m"
    speeds_text = [f"{unit.of(s.speed_mps):g} {unit.name}" for s in (mainline, ramp)]
    rows = (
        ("scenario", f"{scenario.name}: {scenario.description}".rstrip(": ")),
        *_network(scenario),
        (
            "mainline",
            f"{_lanes(mainline.lanes)}{stations}, {speeds_text[0]}",
        ),
        ("ramp", f"{-ramp.start_m:g} m, {speeds_text[1]}{_angle(scenario)}"),
        ("acceleration lane", f"{ramp.acceleration_lane_m:g} m"),
        ("flow, mainline + ramp", run.flows),
        *_demand(scenario),
        ("arrivals", _arrivals(run)),
        ("positioning error, clock error", _errors(safety.positioning_error_m, run)),
        *_kinds(run),
        *_world(run),
        ("computed in", "SUMO" if run.summary["engine"] == "sumo" else "the exact engine"),
    )
    return Table("Road, traffic and errors of this run", ("what", "value"), rows)


def _network(scenario: Scenario) -> tuple[tuple[str, str], ...]:
    if scenario.network is None:
        return ()
    return (("network", f"{scenario.network.ramp} in {Path(scenario.network.file).name}"),)


def _lanes(lanes: int) -> str:
    return f"{lanes} lanes, " if lanes > 1 else ""


def _angle(scenario: Scenario) -> str:
    """The angle at which the ramp of coramp's own road joins; a network has bends of its own."""
    return f", at {scenario.ramp.merge_angle_deg:g}°" if scenario.network is None else ""


def _demand(scenario: Scenario) -> tuple[tuple[str, str], ...]:
    """Where demand over time is from, and its peak."""
    if not scenario.demand:
        return ()
    counts = scenario.counts
    of = "over time" if counts is None else f"{counts.file}, at {counts.mainline} and {counts.ramp}"
    peaks = " + ".join(f"{peak_veh_h(scenario.demand, stream):g}" for stream in STREAMS)
    return (("demand", f"{of}; highest {peaks} veh/h in an interval"),)


def _kinds(run: RunRecords) -> tuple[tuple[str, str], ...]:
    """Who drives, where drivers and automated vehicles mix."""
    if not run.is_mixed:
        return ()
    automated = run.vehicles["automated"].sum()
    others = run.vehicles.height - automated
    return (("vehicles", f"{automated} automated, {others} with {run.summary['drivers']} drivers"),)


def _world(run: RunRecords) -> tuple[tuple[str, str], ...]:
    """What of the world was not perfect, and what came of it."""
    scenario, preset = run.scenario, run.scenario.world.preset
    tables = ", ".join(f"[{t}]" for t in TABLES if not getattr(scenario, t).is_perfect)
    if not tables:
        return ()
    asked = f"{preset}: {tables}" if preset else tables
    happened = told_of_world(run)
    return (("world", f"{asked}; {happened}" if happened else asked),)


def _arrivals(run: RunRecords) -> str:
    listed = [arrival.stream for arrival in run.scenario.arrivals]
    over = f"{run.scenario.simulation.horizon_s:g} s, seed {run.summary['seed']}"
    if not listed:
        return over
    return f"listed, {listed.count('mainline')} + {listed.count('ramp')} vehicles in {over}"


def _errors(positioning_error_m: float, run: RunRecords) -> str:
    safety = run.scenario.safety
    gap = f"; time gap {safety.time_gap_s:g} s" if safety.time_gap_s else ""
    if safety.standstill_gap_m:
        gap += f"; standstill gap {safety.standstill_gap_m:g} m"
    return f"{positioning_error_m:g} m, {safety.clock_error_s:g} s{gap}"
