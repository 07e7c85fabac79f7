"""Cooperative runs, in SUMO and in the exact engine, against plain sumo on the same demand.

Side by side in every round, as ratios. In SUMO both are simulation time, from the start of the
simulation to its end; planning, checking and commands are part of ours. The exact engine's time is
that of a whole run, arrivals and all metrics included.
"""

import statistics
import time

import pytest

from benchmarks.simulation import plain_sumo_s, simulation_clock
from coramp.runs.running import execute, make_spec
from coramp.scenarios.loading import load_scenario
from coramp.strategies.registry import strategy_named
from coramp.worlds.sumo import mixed
from coramp.worlds.sumo.engine import run_cooperative
from coramp.worlds.sumo.files import SumoOptions

ROUNDS = 9
SUMO_AT_MOST = 1.15
EXACT_AT_LEAST, EXACT_AIM = 15.0, 20.0
MIXED_AT_MOST, MIXED_AIM = 6.0, 3.0
"""Of runs among drivers; the aim is not reached yet."""
LANES_AT_MOST, LANES_AIM = 6.0, 1.5
"""Of runs on three lanes with all vehicles automated; the aim is not reached yet."""
SLOTS_AT_LEAST, SLOTS_AIM = 3.0, 8.0
"""Slots plans every vehicle, not those of the ramp alone; the aim is not reached yet."""
THREE_LANES = """
[mainline]
start_m = -600.0
end_m = 600.0
speed_mps = 27.78
lanes = 3
flow_veh_h = 5400.0

[ramp]
start_m = -400.0
speed_mps = 20.0
acceleration_lane_m = 200.0
flow_veh_h = 900.0

[safety]
time_gap_s = 1.0
standstill_gap_m = 2.0
"""
"""The road of docs/how-to/networks.md."""


@pytest.mark.parametrize("strategy", ["mainline-priority", "ramp-priority"])
def test_cooperative_run_against_plain_sumo(benchmark, monkeypatch, tmp_path, strategy):
    scenario = load_scenario("paper", {"mainline.flow_veh_h": 1800.0, "ramp.flow_veh_h": 500.0})
    chosen = strategy_named(strategy)()
    run_cooperative(scenario, chosen, 1, SumoOptions(keep_in=tmp_path / "kept"))
    plain, ours = [], []

    def one_round():
        with simulation_clock(monkeypatch) as clock:
            run_cooperative(scenario, chosen, 1, SumoOptions())
        ours.append(clock.seconds)
        plain.append(plain_sumo_s(tmp_path / "kept"))

    benchmark.pedantic(one_round, rounds=ROUNDS, iterations=1)
    ratio = statistics.median(o / p for o, p in zip(ours, plain, strict=True))
    print(
        f"\n{strategy}, 1800 + 500 veh/h, 1800 s: in SUMO {statistics.median(ours):.3f} s, "
        f"plain sumo {statistics.median(plain):.3f} s, ratio {ratio:.2f} (at most {SUMO_AT_MOST})"
    )
    assert ratio <= SUMO_AT_MOST


@pytest.mark.parametrize("preset", [None, "hard"])
def test_mixed_run_against_plain_sumo(benchmark, monkeypatch, tmp_path, preset):
    overrides = {
        "mainline.flow_veh_h": 1800.0,
        "ramp.flow_veh_h": 500.0,
        "traffic.automated_share": 0.5,
        "safety.time_gap_s": 0.5,
        "safety.standstill_gap_m": 2.0,
        **({} if preset is None else {"world.preset": preset}),
    }
    scenario, chosen = load_scenario("paper", overrides), strategy_named("mixed-slots")()
    mixed.run_mixed(scenario, chosen, "fair", 1, SumoOptions(keep_in=tmp_path / "kept"))
    plain, ours = [], []

    def one_round():
        with simulation_clock(monkeypatch, mixed) as clock:
            mixed.run_mixed(scenario, chosen, "fair", 1, SumoOptions())
        ours.append(clock.seconds)
        plain.append(plain_sumo_s(tmp_path / "kept"))

    benchmark.pedantic(one_round, rounds=ROUNDS, iterations=1)
    ratio = statistics.median(o / p for o, p in zip(ours, plain, strict=True))
    print(
        f"\nmixed-slots at 50 %, 1800 + 500 veh/h, 1800 s, world {preset or 'perfect'}: "
        f"{statistics.median(ours):.3f} s, plain sumo {statistics.median(plain):.3f} s, ratio "
        f"{ratio:.2f} (aim {MIXED_AIM}, at most {MIXED_AT_MOST})"
    )
    assert preset is not None or ratio <= MIXED_AT_MOST


def test_run_on_three_lanes_against_plain_sumo(benchmark, monkeypatch, tmp_path):
    (tmp_path / "three.toml").write_text(THREE_LANES)
    scenario = load_scenario(str(tmp_path / "three.toml"), {"simulation.horizon_s": 300.0})
    chosen = strategy_named("mixed-slots")()
    mixed.run_mixed(scenario, chosen, "credible", 1, SumoOptions(keep_in=tmp_path / "kept"))
    plain, ours = [], []

    def one_round():
        with simulation_clock(monkeypatch, mixed) as clock:
            mixed.run_mixed(scenario, chosen, "credible", 1, SumoOptions())
        ours.append(clock.seconds)
        plain.append(plain_sumo_s(tmp_path / "kept"))

    benchmark.pedantic(one_round, rounds=ROUNDS, iterations=1)
    ratio = statistics.median(o / p for o, p in zip(ours, plain, strict=True))
    print(
        f"\nmixed-slots at 100 % on three lanes, 5400 + 900 veh/h, 300 s: "
        f"{statistics.median(ours):.3f} s, plain sumo {statistics.median(plain):.3f} s, ratio "
        f"{ratio:.2f} (aim {LANES_AIM}, at most {LANES_AT_MOST})"
    )
    assert ratio <= LANES_AT_MOST


def test_exact_run_against_plain_sumo(benchmark, tmp_path):
    spec, in_sumo = (
        make_spec("paper", engine=engine, mainline_veh_h=1800, ramp_veh_h=500)
        for engine in ("exact", "sumo")
    )
    strategy = strategy_named(spec.strategy)()
    run_cooperative(spec.scenario, strategy, 1, SumoOptions(keep_in=tmp_path / "kept"))
    execute(spec)
    exact, plain, sumo = [], [], []

    def one_round():
        plain.append(plain_sumo_s(tmp_path / "kept"))
        started = time.perf_counter()
        execute(in_sumo)
        sumo.append(time.perf_counter() - started)
        times = []
        for _ in range(10):
            started = time.perf_counter()
            execute(spec)
            times.append(time.perf_counter() - started)
        exact.append(statistics.median(times))

    benchmark.pedantic(one_round, rounds=ROUNDS, iterations=1)
    ratio = statistics.median(p / e for e, p in zip(exact, plain, strict=True))
    over_sumo = statistics.median(s / e for e, s in zip(exact, sumo, strict=True))
    print(
        f"\nexact engine, 1800 + 500 veh/h, 1800 s: {statistics.median(exact) * 1e3:.1f} ms, plain "
        f"sumo {statistics.median(plain):.3f} s, {ratio:.1f} times as fast "
        f"(aim {EXACT_AIM:g}), {over_sumo:.1f} times as fast as a run in SUMO"
    )
    assert ratio >= EXACT_AT_LEAST


@pytest.mark.parametrize("time_gap_s", [0.0, 1.0])
def test_exact_run_of_slots_against_plain_sumo(benchmark, tmp_path, time_gap_s):
    spec = make_spec(
        "paper",
        "slots",
        engine="exact",
        mainline_veh_h=1800,
        ramp_veh_h=500,
        overrides={"safety.time_gap_s": time_gap_s},
    )
    strategy = strategy_named(spec.strategy)()
    run_cooperative(spec.scenario, strategy, 1, SumoOptions(keep_in=tmp_path / "kept"))
    execute(spec)
    exact, plain = [], []

    def one_round():
        plain.append(plain_sumo_s(tmp_path / "kept"))
        times = []
        for _ in range(5):
            started = time.perf_counter()
            execute(spec)
            times.append(time.perf_counter() - started)
        exact.append(statistics.median(times))

    benchmark.pedantic(one_round, rounds=ROUNDS, iterations=1)
    ratio = statistics.median(p / e for e, p in zip(exact, plain, strict=True))
    print(
        f"\nexact engine, slots at {time_gap_s:g} s, 1800 + 500 veh/h, 1800 s: "
        f"{statistics.median(exact) * 1e3:.1f} ms, {ratio:.1f} times as fast as plain sumo "
        f"(aim {SLOTS_AIM:g})"
    )
    assert ratio >= SLOTS_AT_LEAST
