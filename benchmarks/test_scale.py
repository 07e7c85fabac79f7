"""Throughput of studies on one and two processes, memory of the driver and of a run, start-up."""

import os
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path

import coramp

SPEEDUP_AT_LEAST = 1.8
DRIVER_AT_MOST_MB = 500
MANY = int(os.environ.get("CORAMP_BENCH_RUNS", "2000"))

STUDY = """
name = "many"
scenario = "paper"
horizon_s = 1800.0

[[runs]]
strategies = ["mainline-priority"]
engine = "exact"
flows_veh_h = [[1800.0, 500.0]]
"""


def study_file(folder):
    path = folder / "many.toml"
    path.write_text(STUDY)
    return str(path)


def resident_mb():
    status = Path("/proc/self/status").read_text().splitlines()
    line = next(line for line in status if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024


def test_two_processes_against_one(benchmark, tmp_path):
    name = study_file(tmp_path)
    coramp.study(name, seeds=8, jobs=2, out=tmp_path / "warm")  # starts the workers
    seconds = {}

    def both():
        for jobs in (1, 2):
            started = time.perf_counter()
            coramp.study(name, seeds=400, jobs=jobs, out=tmp_path / f"with-{jobs}")
            seconds[jobs] = time.perf_counter() - started

    benchmark.pedantic(both, rounds=1, iterations=1)
    speedup = seconds[1] / seconds[2]
    print(
        f"\n400 exact runs: {400 / seconds[1]:.1f} runs/s on one process, {400 / seconds[2]:.1f} "
        f"on two, {speedup:.2f} times (at least {SPEEDUP_AT_LEAST})"
    )
    assert speedup >= SPEEDUP_AT_LEAST


def test_the_driver_of_many_runs(benchmark, tmp_path):
    marks = []

    def note(state):
        if state.done % max(1, MANY // 10) == 0:
            marks.append((state.done, time.perf_counter(), resident_mb()))

    benchmark.pedantic(
        coramp.study,
        args=(study_file(tmp_path),),
        kwargs={"seeds": MANY, "jobs": 2, "out": tmp_path / "o", "progress": note},
        rounds=1,
        iterations=1,
    )
    rates = [(b[0] - a[0]) / (b[1] - a[1]) for a, b in pairwise(marks) if b[0] > a[0]]
    largest_mb = max(mb for *_, mb in marks)
    print(
        f"\n{MANY} exact runs: {rates[1]:.1f} runs/s at first, {rates[-1]:.1f} at last; driver "
        f"{largest_mb:.0f} MB resident at most (at most {DRIVER_AT_MOST_MB})"
    )
    assert largest_mb < DRIVER_AT_MOST_MB
    assert rates[-1] > 0.8 * rates[1]


def test_memory_of_a_run(benchmark):
    code = (
        "import coramp, resource; coramp.run('paper', engine='{}', mainline_veh_h=3600, "
        "ramp_veh_h=1500); print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)"
    )

    def megabytes(engine):
        done = subprocess.run(
            [sys.executable, "-c", code.format(engine)], capture_output=True, text=True, check=True
        )
        return int(done.stdout)

    exact = benchmark.pedantic(megabytes, args=("exact",), rounds=1, iterations=1)
    print(f"\na run at 3600 + 1500, whole process: exact {exact} MB, SUMO {megabytes('sumo')} MB")


def test_start_up(benchmark):
    command = [str(Path(sys.executable).with_name("coramp")), "--help"]
    benchmark.pedantic(
        subprocess.run,
        args=(command,),
        kwargs={"capture_output": True, "check": True},
        rounds=5,
        iterations=1,
        warmup_rounds=1,
    )
    print(f"\ncoramp --help: {benchmark.stats.stats.median * 1e3:.0f} ms (at most 300)")
    assert benchmark.stats.stats.median < 0.3
