"""A cooperative run in SUMO against plain sumo on the same network and routes, side by side.

Both as simulation time: from the start of the simulation to its end, without start-up. Planning,
audit and commands are part of the cooperative run; plain sumo writes nothing.
"""

import re
import statistics
import subprocess
import time
from contextlib import contextmanager
from dataclasses import dataclass

import pytest

from coramp.engines.sumo import engine
from coramp.engines.sumo.engine import SumoOptions, run_cooperative
from coramp.engines.sumo.network import sumo_binary
from coramp.engines.sumo.session import Session
from coramp.loading import load_scenario
from coramp.strategies.registry import strategy_named

ROUNDS = 9
TARGET = 1.3


@dataclass
class Clock:
    seconds: float = 0.0


@contextmanager
def simulation_clock(monkeypatch):
    """Times what happens between the start and the close of SUMO sessions."""
    clock = Clock()

    class Timed(Session):
        def __enter__(self):
            self.started = time.perf_counter()
            return super().__enter__()

        def __exit__(self, *reason):
            clock.seconds = time.perf_counter() - self.started
            return super().__exit__(*reason)

    with monkeypatch.context() as patched:
        patched.setattr(engine, "Session", Timed)
        yield clock


def plain_sumo_s(folder):
    """Returns the simulation time that sumo itself reports."""
    command = (folder / "command.txt").read_text().split()[1:]
    done = subprocess.run(
        [sumo_binary("sumo"), *command, "--duration-log.statistics", "--no-warnings"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    found = re.search(r"Duration: ([0-9.]+)s", done.stdout)
    assert found is not None, done.stdout
    return float(found.group(1))


@pytest.mark.parametrize("strategy", ["mainline-priority", "ramp-priority"])
def test_cooperative_run_against_plain_sumo(benchmark, monkeypatch, tmp_path, strategy):
    scenario = load_scenario("paper", {"mainline.flow_veh_h": 1800.0, "ramp.flow_veh_h": 500.0})
    chosen = strategy_named(strategy)()
    run_cooperative(scenario, chosen, 1, SumoOptions(keep_in=tmp_path / "kept"))
    ratios, plain, ours = [], [], []

    def one_round():
        with simulation_clock(monkeypatch) as clock:
            run_cooperative(scenario, chosen, 1, SumoOptions())
        ours.append(clock.seconds)
        plain.append(plain_sumo_s(tmp_path / "kept"))
        ratios.append(ours[-1] / plain[-1])

    benchmark.pedantic(one_round, rounds=ROUNDS, iterations=1)
    ratio = statistics.median(ratios)
    benchmark.extra_info["ratio to plain sumo"] = round(ratio, 2)
    print(
        f"\n{strategy}, 1800 + 500 veh/h, 1800 s: cooperative {statistics.median(ours):.2f} s, "
        f"plain sumo {statistics.median(plain):.2f} s, ratio {ratio:.2f} (at most {TARGET})"
    )
    assert ratio <= TARGET
