"""Which runs are kept: drawn once, with a fixed seed, over all that a row depends on."""

import random
from typing import Any, NamedTuple

PLANNERS = ("mainline-priority", "ramp-priority", "fifo-optimal-control", "slots")
SEQUENCES = ("dp-sequence", "milp-sequence", "game")
FEEDBACK = ("virtual-platoon", "ocbf")
SCENARIOS = ("paper", "paper", "paper", "expressway", "motorway")
SETTINGS: tuple[dict[str, Any], ...] = (
    {},
    {},
    {"safety.positioning_error_m": 0.5, "control.actuation_delay_s": 0.3},
    {"ramp.acceleration_lane_m": 120.0, "safety.adhesion": 0.3},
    {"control.gap_position": "front"},
    {"control.gap_creation_start": "nose"},
    {"control.step_s": 0.05},
    {"mainline.entry_speed_mps": [17.0, 19.0]},
)
TIME_GAPS_S = (0.6, 0.8, 1.0, 1.4)


class Kept(NamedTuple):
    """One kept run: the arguments of ``make_spec``."""

    scenario: str
    strategy: str
    options: dict[str, Any]


def kept_runs() -> list[Kept]:
    """Returns the runs, in a fixed order."""
    draw = random.Random(20261129)
    runs = [_planned(draw, name, "exact") for name in PLANNERS for _ in range(22)]
    runs += [_planned(draw, name, "exact", at_most=0.7) for name in SEQUENCES for _ in range(8)]
    runs += [_planned(draw, name, "exact", at_most=0.8) for name in FEEDBACK for _ in range(12)]
    runs += [_at_time_gap(draw, name) for name in PLANNERS for _ in range(12)]
    runs += [_planned(draw, n, "sumo") for n in (*PLANNERS, *SEQUENCES, *FEEDBACK) for _ in "12"]
    runs += [_of_drivers(draw) for _ in range(12)]
    return runs


def _flows(draw: random.Random, at_most: float = 1.0) -> dict[str, Any]:
    return {
        "mainline_veh_h": float(round(draw.uniform(600, 3000) * at_most, -1)),
        "ramp_veh_h": float(round(draw.uniform(200, 1100) * at_most, -1)),
        "seed": draw.randrange(1000),
        "horizon_s": float(draw.choice((90, 150, 240))),
    }


def _planned(draw: random.Random, strategy: str, engine: str, at_most: float = 1.0) -> Kept:
    scenario = draw.choice(SCENARIOS)
    settings = dict(draw.choice(SETTINGS)) if scenario == "paper" else {}
    if scenario == "motorway":
        at_most = min(at_most, 0.6)
    options = {**_flows(draw, at_most), "engine": engine, "overrides": settings}
    if engine == "sumo":
        options["horizon_s"] = 90.0
    return Kept(scenario, strategy, options)


def _at_time_gap(draw: random.Random, strategy: str) -> Kept:
    settings: dict[str, Any] = {"safety.time_gap_s": draw.choice(TIME_GAPS_S)}
    if draw.random() < 0.3:
        settings["safety.standstill_gap_m"] = 2.5
    options = {**_flows(draw, 0.75), "engine": "exact", "overrides": settings}
    return Kept("paper", strategy, options)


def _of_drivers(draw: random.Random) -> Kept:
    drivers = draw.choice(("fair", "paper", "credible", "automated-0.8", "fair-sigma0"))
    strategy = draw.choice(("uncontrolled", "uncontrolled", "alinea"))
    options = {**_flows(draw, 0.7), "drivers": drivers, "horizon_s": 120.0}
    return Kept(draw.choice(("paper", "expressway")), strategy, options)
