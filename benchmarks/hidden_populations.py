"""``python -m benchmarks.hidden_populations``: what calibration finds of hidden drivers.

For each hidden population: detectors' data of some mornings is made, ``coramp calibrate`` is given
that data alone, and the drivers that it finds are compared with the hidden ones over ten seeds of
which no morning was made. Both meet the same flow, which rises until the merge breaks down.

Capacity is the mean over these seeds of the highest 5-minute flow behind the merge before the
breakdown. Free speed is the mean speed 200 m before the nose in light traffic, over the same seeds.
What was simulated is kept in the folder ``--kept``, so that an interrupted measurement goes on.
"""

import argparse
import hashlib
import math
import os
from concurrent.futures import ThreadPoolExecutor
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from coramp.calibration.effort import Effort
from coramp.calibration.from_files import Asked, calibrated
from coramp.calibration.models import SUMO_NAMES, speed_factor
from coramp.calibration.series import capacity_veh_h, series_of
from coramp.cli.calibration_progress import CalibrationProgress
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.sections import DriverPopulation
from coramp.worlds.sumo.detected import build_network, detected

LOOPS = (("M1", "mainline", -380.0), ("M2", "mainline", -200.0), ("M3", "mainline", 390.0))
LOOPS += (("R1", "ramp", -380.0),)
QUEUES, LEAVES = "M2", "M3"
SEEDS = tuple(range(101, 111))
"""Of the comparison; mornings have seeds from 1 to 99."""
CAPACITY_WITHIN, SPEED_WITHIN = 0.03, 0.01
LIGHT_VEH_H = (400.0, 60.0)


class Flows(NamedTuple):
    """Mainline and ramp flows (veh/h) at the start, the ramp's at the end, and how long (s)."""

    mainline: float
    ramp: float
    ramp_to: float
    horizon_s: float = 3600.0


class Hidden(NamedTuple):
    """A population that calibration is not told, the flows of its mornings and their seed."""

    name: str
    drivers: DriverPopulation
    flows: Flows
    seed: int
    scenario: str = "paper"

    @property
    def model(self):
        return self.drivers.car_following.lower()


class NoBreakdownError(Exception):
    """The data of a hidden population would have no breakdown."""


class Place:
    """Simulates populations on scenarios with detectors, and keeps what they told in a folder."""

    def __init__(self, folder, jobs):
        self.folder, self.jobs = folder, jobs
        folder.mkdir(parents=True, exist_ok=True)

    def road(self, scenario):
        """Returns a scenario file with the detectors."""
        file = self.folder / f"{scenario}.toml"
        if not file.exists():
            text = files("coramp").joinpath(f"data/scenarios/{scenario}.toml").read_text()
            loops = (
                f'\n[[detector]]\nid = "{name}"\nroad = "{road}"\nstation_m = {station_m}\n'
                for name, road, station_m in LOOPS
            )
            file.write_text(text + "".join(loops))
        return file

    def told(self, scenario, flows, drivers, seeds):
        """Returns what detectors tell, a frame for each seed."""
        loaded = load_scenario(
            str(self.road(scenario)),
            {
                "mainline.flow_veh_h": flows.mainline,
                "ramp.flow_veh_h": flows.ramp,
                "ramp.flow_to_veh_h": flows.ramp_to,
                "simulation.horizon_s": flows.horizon_s,
            },
        )
        build_network(loaded, drivers)
        own = f"{scenario} {tuple(flows)} {drivers.model_copy(update={'origin': ''})!r}"

        def one(seed):
            key = hashlib.sha256(f"{own} {seed}".encode()).hexdigest()[:24]
            file = self.folder / f"{key}.parquet"
            if not file.exists():
                detected(loaded, drivers, seed).write_parquet(file)
            return pl.read_parquet(file)

        with ThreadPoolExecutor(self.jobs) as pool:
            return list(pool.map(one, seeds))


def capacities_veh_h(place, hidden, drivers, seeds=SEEDS):
    """Returns the highest flow before the breakdown of each seed, nan where nothing broke down."""
    v0_mps = load_scenario(hidden.scenario).mainline.speed_mps
    free_mps = v0_mps * (1.0 if drivers.speed_factor is None else drivers.speed_factor.mean)
    frames = place.told(hidden.scenario, hidden.flows, drivers, seeds)
    found = [capacity_veh_h(series_of(one), QUEUES, LEAVES, free_mps) for one in frames]
    return np.array([math.nan if one is None else one for one in found])


def free_mps(place, hidden, drivers):
    """Returns the mean speed in light traffic."""
    mainline, ramp = LIGHT_VEH_H
    light = Flows(mainline, ramp, ramp, 1200.0)
    told = pl.concat(place.told(hidden.scenario, light, drivers, SEEDS))
    own = told.filter(pl.col("detector") == QUEUES, pl.col("vehicles") > 0)
    return float((own["vehicles"] * own["mean_speed_mps"]).sum() / own["vehicles"].sum())


def morning_file(place, hidden, mornings):
    """Writes the data of some mornings one after the other, and returns the file.

    Seeds without a breakdown are left out, as the data must have one each morning.
    """
    frames, seed = [], hidden.seed
    while len(frames) < mornings:
        if seed > hidden.seed + 10 * mornings:
            raise NoBreakdownError(f"{hidden.name}: the flows do not make its merge break down")
        if not np.isnan(capacities_veh_h(place, hidden, hidden.drivers, [seed]))[0]:
            (frame,) = place.told(hidden.scenario, hidden.flows, hidden.drivers, [seed])
            shift_s = len(frames) * hidden.flows.horizon_s
            frames.append(frame.with_columns(pl.col("begin_s", "end_s") + shift_s))
        seed += 1
    file = place.folder / f"{hidden.name}-{hidden.seed}-{mornings}.csv"
    pl.concat(frames).write_csv(file)
    return file


def measured(place, hidden, mornings, effort):
    """Calibrates to the data of a hidden population; returns a row of the table."""
    data = morning_file(place, hidden, mornings)
    before_s = sum(os.times()[:4])
    with CalibrationProgress(effort.total, effort.jobs) as progress:
        told = effort.told_to(progress)
        road = str(place.road(hidden.scenario))
        found, _ = calibrated(road, data, Asked(hidden.model), told)
    took_s = sum(os.times()[:4]) - before_s
    both = (hidden.drivers, found.drivers)
    capacity = [capacities_veh_h(place, hidden, drivers) for drivers in both]
    speed = [free_mps(place, hidden, drivers) for drivers in both]
    factors = [1.0 if d.speed_factor is None else d.speed_factor.mean for d in both]
    return {
        "hidden": hidden.name,
        "mornings": mornings,
        "begins": (hidden.flows.mainline + hidden.flows.ramp) / np.nanmean(capacity[0]),
        "capacity": np.nanmean(capacity[0]),
        "error": np.nanstd(capacity[0], ddof=1) / np.sqrt(np.isfinite(capacity[0]).sum()),
        "found": np.nanmean(capacity[1]),
        "broke": int(np.isfinite(capacity[1]).sum()),
        "of": int(np.isfinite(capacity[0]).sum()),
        "off": np.nanmean(capacity[1]) / np.nanmean(capacity[0]) - 1.0,
        "free": speed[0],
        "free_off": speed[1] / speed[0] - 1.0,
        "desired_off": factors[1] / factors[0] - 1.0,
        "took_s": took_s,
        "drivers": found.drivers,
    }


def line_of(row):
    """Returns a row of the table in Markdown."""
    return (
        f"| {row['hidden']} | {row['mornings']} | {100 * row['begins']:.0f} "
        f"| {row['capacity']:.0f} ± {row['error']:.0f} "
        f"| {row['found']:.0f} | {100 * row['off']:+.1f} | {row['broke']} of {row['of']} "
        f"| {row['free']:.2f} | {100 * row['free_off']:+.2f} | {100 * row['desired_off']:+.2f} "
        f"| {row['took_s']:.0f} |"
    )


HEAD = """\
| hidden | mornings | begins at (% of capacity) | capacity (veh/h) | found | off by (%) \
| broke down | free speed (m/s) | off by (%) | desired speed off by (%) | processor time (s) |
|---|---|---|---|---|---|---|---|---|---|---|"""


def drivers_of(model, tau_s, accel_mps2, speed, **rest):
    """Returns a population of a model; ``speed`` is mean and deviation of the speed factor."""
    return DriverPopulation(
        wish="free-flow",
        car_following=SUMO_NAMES[model],
        tau_s=tau_s,
        accel_mps2=accel_mps2,
        speed_factor=speed_factor(*speed),
        **rest,
    )


def named():
    """Returns the hidden populations that were chosen by hand."""
    credible = load_scenario("paper").drivers["credible"]
    flows = Flows(1400.0, 300.0, 1500.0)
    return [
        Hidden("credible", credible, flows, 1),
        Hidden("credible-b", credible, Flows(1500.0, 200.0, 1200.0), 7),
        Hidden(
            "slow",
            drivers_of("krauss", 1.5, 1.2, (0.9, 0.05), sigma=0.6),
            Flows(1000.0, 150.0, 1200.0),
            2,
        ),
        Hidden(
            "close",
            drivers_of("krauss", 0.9, 2.2, (1.05, 0.1), sigma=0.3, min_gap_m=2.0),
            Flows(1700.0, 400.0, 1900.0),
            3,
        ),
        Hidden(
            "selfish",
            drivers_of("krauss", 1.2, 1.8, (0.97, 0.03), lc_cooperative=0.5, lc_assertive=1.6),
            Flows(1300.0, 200.0, 1500.0),
            4,
        ),
        Hidden(
            "idm",
            drivers_of("idm", 1.1, 1.6, (0.98, 0.06), min_gap_m=2.0),
            Flows(1200.0, 200.0, 1400.0),
            5,
        ),
        Hidden(
            "idm-short",
            drivers_of("idm", 0.8, 2.2, (0.92, 0.04)),
            Flows(1400.0, 300.0, 1800.0),
            6,
        ),
        Hidden(
            "eidm",
            drivers_of("eidm", 1.1, 1.8, (1.0, 0.07)),
            Flows(1300.0, 200.0, 1500.0),
            8,
        ),
        Hidden(
            "eidm-long",
            drivers_of("eidm", 1.5, 1.4, (0.93, 0.05), min_gap_m=3.0),
            Flows(1100.0, 200.0, 1300.0),
            9,
        ),
    ]


def drawn(number):
    """Returns a hidden population by chance: the number decides all of it."""
    random = np.random.default_rng(number)

    def between(low, high):
        return round(float(random.uniform(low, high)), 3)

    model = ("krauss", "idm", "eidm")[number % 3]
    tau_s = between(0.9, 1.6)
    alike = random.random() < 0.5
    drivers = drivers_of(
        model,
        tau_s if alike else tuple(round(tau_s * (1.0 + 0.1 * k), 3) for k in (-2, -1, 0, 1, 2)),
        between(1.2, 2.4),
        (between(0.88, 1.05), between(0.02, 0.1)),
        min_gap_m=between(1.5, 3.5),
        lc_cooperative=between(0.5, 1.0),
        lc_assertive=between(0.8, 1.8),
        sigma=between(0.2, 0.7),
    )
    mainline = between(1100.0, 1500.0)
    flows = Flows(mainline, between(150.0, 350.0), between(1300.0, 1700.0))
    return Hidden(f"{model}-{number}", drivers, flows, 1 + number % 90)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--named", nargs="*", metavar="NAME", help="these alone; none for all")
    parser.add_argument("--drawn", nargs="*", type=int, default=[], metavar="NUMBER")
    parser.add_argument("--mornings", type=int, default=1)
    parser.add_argument("--runs", type=int, default=Effort().runs)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--kept", type=Path, default=Path("out/hidden-populations"))
    parser.add_argument("--noise", action="store_true", help="only the hidden ones' capacities")
    given = parser.parse_args()
    chosen = [] if given.named is None else named()
    chosen = [one for one in chosen if not given.named or one.name in given.named]
    chosen += [drawn(number) for number in given.drawn]
    place = Place(given.kept, given.jobs)
    if given.noise:
        for hidden in chosen:
            found = capacities_veh_h(place, hidden, hidden.drivers)
            print(hidden.name, found.tolist(), np.nanmean(found), np.nanstd(found, ddof=1))
        return
    print(HEAD, flush=True)
    rows = []
    for hidden in chosen:
        effort = Effort(runs=given.runs, jobs=given.jobs)
        try:
            row = measured(place, hidden, given.mornings, effort)
        except NoBreakdownError as error:
            print(f"Left out: {error}", flush=True)
            continue
        rows.append(row)
        print(line_of(row), flush=True)
        (given.kept / f"{hidden.name}-{given.mornings}.txt").write_text(
            f"{hidden.drivers!r}\n{row['drivers']!r}\n{line_of(row)}\n"
        )
    within = [abs(row["off"]) <= CAPACITY_WITHIN for row in rows]
    fast = [abs(row["free_off"]) <= SPEED_WITHIN for row in rows]
    print(f"{sum(within)} of {len(rows)} capacities within 3 %, {sum(fast)} free speeds within 1 %")


if __name__ == "__main__":
    main()
