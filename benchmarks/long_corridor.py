"""A corridor of 10 km with five on-ramps and four exits: time and memory by vehicles.

``python -m benchmarks.long_corridor`` measures all; ``--help`` tells what can be chosen. Every
run has a process of its own. Flows stay the same: more vehicles are a longer horizon.
"""

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import sumo

from coramp.runs.corridors import corridor_spec, execute_corridor
from coramp.worlds.sumo import corridor
from coramp.worlds.sumo.network import sumo_binary

LENGTH_M, LANES, ACCELERATION_LANE_M = 10_000, 3, 160
NOSES_M = (1000, 3000, 5000, 7000, 9000)
FORKS_M = (2200, 4200, 6200, 8200)
MAINLINE_VEH_H, RAMP_VEH_H, EXIT_SHARE = 3000.0, 400.0, 0.1
CASES = {
    "100 %": ("mixed-slots", 1.0),
    "50 %": ("mixed-slots", 0.5),
    "uncontrolled": ("uncontrolled", 0.0),
}
VEHICLES = (2_500, 5_000, 10_000, 20_000)
DRIVERS = "credible"
SPEED_MPS, RAMP_MPS = 27.78, 22.22
WRITES = ("--tripinfo-output", "--collision-output", "--fcd-output", "--precision")
"""What SUMO writes in a run of coramp's, and plain ``sumo`` does not."""


def built(folder):
    """Returns the file of the corridor's network, made by netconvert in a folder."""
    at_m = {"west": 0, "east": LENGTH_M}
    at_m |= {f"nose{k}": x for k, x in enumerate(NOSES_M, 1)}
    at_m |= {f"end{k}": x + ACCELERATION_LANE_M for k, x in enumerate(NOSES_M, 1)}
    at_m |= {f"fork{k}": x for k, x in enumerate(FORKS_M, 1)}
    nodes = [f'<node id="{name}" x="{x}" y="0"/>' for name, x in at_m.items()]
    nodes += [f'<node id="on{k}" x="{x - 400}" y="-90"/>' for k, x in enumerate(NOSES_M, 1)]
    nodes += [f'<node id="out{k}" x="{x + 350}" y="-120"/>' for k, x in enumerate(FORKS_M, 1)]
    edges, links = [], []
    along = sorted(at_m, key=lambda name: at_m[name])
    for start, end in pairwise(along):
        merges = start.startswith("nose")
        edges.append(_edge(f"from-{start}", start, end, LANES + merges, SPEED_MPS))
        if end != "east":
            shift = end.startswith("nose")
            links += [
                _link(f"from-{start}", f"from-{end}", lane + merges, lane + shift)
                for lane in range(LANES)
            ]
    for k in range(1, len(NOSES_M) + 1):
        edges.append(_edge(f"ramp{k}", f"on{k}", f"nose{k}", 1, RAMP_MPS))
        links.append(_link(f"ramp{k}", f"from-nose{k}", 0, 0))
    for k in range(1, len(FORKS_M) + 1):
        edges.append(_edge(f"exit{k}", f"fork{k}", f"out{k}", 1, RAMP_MPS))
        links.append(_link(f"from-end{k}", f"exit{k}", 0, 0))
    command = [str(Path(sumo.SUMO_HOME) / "bin" / "netconvert"), "--no-turnarounds"]
    for kind, lines in (("node", nodes), ("edge", edges), ("connection", links)):
        path = folder / f"long.{kind}.xml"
        path.write_text("\n".join([f"<{kind}s>", *lines, f"</{kind}s>"]))
        command += [f"--{kind}-files", str(path)]
    network = folder / "long.net.xml"
    command += ["--junctions.limit-turn-speed", "-1", "--output-file", str(network)]
    subprocess.run(command, check=True, capture_output=True)
    return network


def _edge(name, start, end, lanes, speed_mps):
    return f'<edge id="{name}" from="{start}" to="{end}" numLanes="{lanes}" speed="{speed_mps}"/>'


def _link(start, end, from_lane, to_lane):
    lanes = f'fromLane="{from_lane}" toLane="{to_lane}"'
    return f'<connection from="{start}" to="{end}" {lanes}/>'


def written(folder):
    """Returns the file of the corridor's scenario in a folder, its network beside it."""
    network, path = built(folder), folder / "long.toml"
    ramps = [f"ramp{k}@from-nose{k}" for k in range(1, len(NOSES_M) + 1)]
    command = [str(Path(sys.executable).with_name("coramp")), "new-scenario", "long"]
    command += ["--net", str(network), *(part for ramp in ramps for part in ("--ramp", ramp))]
    subprocess.run(command, check=True, capture_output=True, cwd=folder)
    return path


def horizon_s(vehicles):
    """Returns for how long (s) vehicles arrive so that there are about so many."""
    return vehicles * 3600.0 / (MAINLINE_VEH_H + len(NOSES_M) * RAMP_VEH_H)


def overrides(vehicles, share):
    """Returns the scenario's keys for a number of vehicles and a share of automated ones."""
    return {
        "simulation.horizon_s": horizon_s(vehicles),
        "corridor.mainline_flow_veh_h": MAINLINE_VEH_H,
        "corridor.ramp_flow_veh_h": [RAMP_VEH_H] * len(NOSES_M),
        "traffic.automated_share": share,
    }


class Watched(corridor.Session):
    """A session whose time (s) is taken, and whose files are kept for plain ``sumo``."""

    folder = Path()
    seconds = 0.0

    def __init__(self, options, step_s, *rest):
        for name in ("--route-files", "--additional-files"):
            if name in options:
                path = Path(options[options.index(name) + 1])
                shutil.copy(path, self.folder / path.name)
        kept = [o.replace(str(Path(path).parent), str(self.folder)) for o in options]
        command = [*_without(kept), "--step-length", repr(step_s)]
        (self.folder / "command.json").write_text(json.dumps(command))
        super().__init__(options, step_s, *rest)

    def __enter__(self):
        self.started = time.perf_counter()
        return super().__enter__()

    def __exit__(self, *reason):
        Watched.seconds = time.perf_counter() - self.started
        return super().__exit__(*reason)


def _without(options):
    """Options of SUMO without those that name what it writes."""
    pairs = zip(options[::2], options[1::2], strict=True)
    return [part for pair in pairs if not pair[0].startswith(WRITES) for part in pair]


def measured(scenario, case, vehicles, folder):
    """Returns the figures of one run in this process: times (s), memory (MB), what came of it."""
    strategy, share = CASES[case]
    Watched.folder, corridor.Session = Path(folder), Watched
    spec = corridor_spec(scenario, strategy, drivers=DRIVERS, overrides=overrides(vehicles, share))
    started = time.perf_counter()
    result = execute_corridor(spec)
    wall_s = time.perf_counter() - started
    used = resource.getrusage(resource.RUSAGE_SELF)
    told = (
        "vehicles", "unserved", "collisions_by_automated", "collisions", "mean_delay_s",
        "merges", "made_way", "plan_error_m", "most_at_once",
    )  # fmt: skip
    return {
        "wall_s": wall_s,
        "cpu_s": used.ru_utime + used.ru_stime,
        "in_sumo_s": Watched.seconds,
        "memory_mb": used.ru_maxrss / 1024,
        **{name: result.summary[name] for name in told},
    }


PLAIN = """
import json, resource, subprocess, sys, time
started = time.perf_counter()
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
wall_s, cpu_s = time.perf_counter() - started, used.ru_utime + used.ru_stime
print(json.dumps({"wall_s": wall_s, "cpu_s": cpu_s, "memory_mb": used.ru_maxrss / 1024}))
"""
"""A small process of its own: what a process starts counts its memory as its own."""


def plain_sumo(folder):
    """Returns wall time (s), CPU time (s) and memory (MB) of plain ``sumo`` on a run's files."""
    options = json.loads((folder / "command.json").read_text())
    command = [sys.executable, "-c", PLAIN, sumo_binary("sumo"), *options]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return json.loads(done.stdout)


def in_own_process(scenario, case, vehicles, folder):
    """Returns ``measured`` of a process of its own, and plain ``sumo`` on the same files."""
    command = [sys.executable, "-m", "benchmarks.long_corridor", "--one", str(scenario), case]
    command += [str(vehicles), str(folder)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return {"case": case, **json.loads(done.stdout), "plain": plain_sumo(folder)}


def told(row):
    """Returns a run's figures as a line."""
    plain = row["plain"]
    return (
        f"{row['case']:>12} {row['vehicles']:>7} {row['most_at_once']:>6} {row['wall_s']:>8.1f} "
        f"{row['cpu_s']:>8.1f} {plain['cpu_s']:>8.1f} {row['cpu_s'] / plain['cpu_s']:>6.2f} "
        f"{row['memory_mb']:>7.0f} {plain['memory_mb']:>7.0f} {row['mean_delay_s']:>7.1f} "
        f"{row['unserved']:>5} {row['collisions_by_automated']:>5} {row['collisions']:>5}"
    )


HEAD = (
    f"{'':>12} {'':>7} {'most':>6} {'wall':>8} {'CPU':>8} {'sumo CPU':>8} {'':>6} {'memory':>7} "
    f"{'sumo':>7} {'delay':>7} {'':>5} {'hit by':>5} {'':>5}\n"
    f"{'automated':>12} {'seen':>7} {'seen':>6} {'s':>8} {'s':>8} {'s':>8} {'times':>6} {'MB':>7} "
    f"{'MB':>7} {'s':>7} {'left':>5} {'CAVs':>6} {'all':>4}"
)


def main():
    """Measures the runs that are asked for, and prints a line for each."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.long_corridor", description=__doc__)
    parser.add_argument("--vehicles", type=int, nargs="+", default=list(VEHICLES))
    parser.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--one", nargs=4, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.one:
        scenario, case, vehicles, folder = asked.one
        print(json.dumps(measured(scenario, case, int(vehicles), folder)))
        return
    print(HEAD)
    with tempfile.TemporaryDirectory() as name:
        scenario = written(Path(name))
        for vehicles in asked.vehicles:
            for case in asked.cases:
                print(told(in_own_process(scenario, case, vehicles, Path(name))), flush=True)


if __name__ == "__main__":
    main()
