"""The files that SUMO reads and writes in a run, and what is read from them."""

import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.coordination.plant import Arrival
from coramp.records.files import write_text
from coramp.records.run_folder import (
    DETECTED,
    SUMO_COMMAND,
    SUMO_COPIES,
    SUMO_DETECTED,
    SUMO_DETECTORS,
    SUMO_LOOPS,
    SUMO_NETWORK,
)
from coramp.scenarios.model import Scenario
from coramp.worlds.sumo.detectors import Loop, counted, loops_file, loops_of
from coramp.worlds.sumo.lanes import LanedRoad
from coramp.worlds.sumo.network import RAMP_LANE, LaneSpan, RoadPlan

PLAIN_OPTIONS = ("--no-step-log", "true", "--time-to-teleport", "-1", "--collision.action", "warn")
COLLISION_OPTIONS = ("--collision.mingap-factor", "0", "--collision.check-junctions", "true")


@dataclass(frozen=True)
class Samples:
    """Positions of SUMO's vehicles at its steps, by vehicle and time.

    ``lane`` is that of the mainline, 0 next to the ramp, or -1 on the ramp and the acceleration
    lane.
    """

    vehicle: IntArray
    lane: IntArray
    time_s: FloatArray
    station_m: FloatArray
    speed_mps: FloatArray

    @property
    def on_mainline(self) -> BoolArray:
        """Which are neither on the ramp nor on the acceleration lane."""
        return np.asarray(self.lane > RAMP_LANE)

    @property
    def motion(self) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Vehicles, times, stations and speeds."""
        return self.vehicle, self.time_s, self.station_m, self.speed_mps


@dataclass(frozen=True)
class SumoOptions:
    """How a run is watched: files kept in a folder, a window, messages kept in the outcome.

    ``tell`` is told, while SUMO runs, the time (s) that is simulated, and infinity at its end.
    ``keep_heard`` keeps what the coordinator of mixed traffic knew in a world that fails.
    """

    keep_in: Path | None = None
    gui: bool = False
    keep_messages: bool = False
    tell: Callable[[float], None] | None = None
    keep_heard: bool = False


class RunRoad(Protocol):
    """What a run's files need of its road: the network's file, SUMO's options, where lanes lie."""

    @property
    def file(self) -> Path:
        """The network's file."""
        ...

    @property
    def options(self) -> tuple[str, ...]:
        """SUMO's options for this network."""
        ...

    @property
    def additional(self) -> str | None:
        """What SUMO is told beside the network, None without any."""
        ...

    def spans(self) -> Mapping[str, LaneSpan]:
        """Returns where each lane lies."""
        ...


class RunFiles:
    """The files of one run in a folder of its own, and what is read from them."""

    def __init__(
        self,
        folder: Path,
        scenario: Scenario,
        plan: RunRoad,
        seed: int,
        options: SumoOptions,
        ballistic: bool,
        sampled: bool = False,
    ) -> None:
        self._folder = folder
        self._scenario = scenario
        self._plan = plan
        self._detectors: list[Loop] = []
        self._step_s = scenario.control.step_s
        self._seed = seed
        self._keep_in = options.keep_in
        self._ballistic = ballistic
        self._sampled = sampled
        self._cap_s = scenario.simulation.horizon_s + scenario.simulation.drain_s

    def write_routes(self, text: str) -> None:
        """Writes the route file."""
        (self._folder / "routes.rou.xml").write_text(text)

    def write_additional(self) -> None:
        """Writes what SUMO is told beside the network, if anything."""
        if (text := self._plan.additional) is not None:
            self.write_loops(text)

    def write_loops(self, text: str) -> None:
        """Writes the file of loop detectors; without it there are none."""
        (self._folder / SUMO_LOOPS).write_text(text)

    def write_detectors(self, arrivals: Sequence[Arrival]) -> None:
        """Writes the scenario's detectors where SUMO's files are kept; routes must be written."""
        if self._keep_in is None or not isinstance(self._plan, RoadPlan | LanedRoad):
            return
        if not self._scenario.detector:
            return
        routes = (self._folder / "routes.rou.xml").read_text()
        self._detectors = loops_of(self._scenario, self._plan, arrivals, routes)
        (self._folder / SUMO_DETECTORS).write_text(loops_file(self._detectors))

    def _loops(self, folder: Path | None = None) -> list[str]:
        """The option that names the files of loops, in a folder or where SUMO is started."""
        names = [name for name in (SUMO_LOOPS, SUMO_DETECTORS) if (self._folder / name).exists()]
        paths = [name if folder is None else str(folder / name) for name in names]
        return ["--additional-files", ",".join(paths)] if paths else []

    def options(self) -> list[str]:
        """Returns SUMO's options, output files included."""
        folder = self._folder
        result = [
            *("--net-file", str(self._plan.file)),
            *("--route-files", str(folder / "routes.rou.xml")),
            *("--seed", str(self._seed), *PLAIN_OPTIONS, *COLLISION_OPTIONS),
            *("--no-warnings", "true", "--collision-output", str(folder / "collisions.xml")),
            *self._loops(folder),
            *self._plan.options,
        ]
        result += self._step_method
        if self._sampled or self._keep_in is not None:
            result += ["--fcd-output", str(folder / "fcd.parquet"), "--precision", "4"]
            result += ["--tripinfo-output", str(folder / "tripinfo.xml")]
        if self._keep_in is None:
            result += ["--fcd-output.attributes", "lane,pos,speed"] if self._sampled else []
        else:
            result += ["--tripinfo-output.write-unfinished", "--tripinfo-output.write-undeparted"]
        return result

    @property
    def _step_method(self) -> tuple[str, str]:
        """How SUMO integrates, said outright: left out, it is ballistic where drivers look rarely.

        SUMO takes ballistic steps for all as soon as one type's actions are rarer than its steps.
        """
        return "--step-method.ballistic", "true" if self._ballistic else "false"

    def keep(self) -> None:
        """Copies the files to where they are to be kept, with a command that uses them."""
        if self._keep_in is None:
            return
        self._keep_in.mkdir(parents=True, exist_ok=True)
        shutil.copy(self._plan.file, self._keep_in / self._network_name)
        for name in SUMO_COPIES:
            shutil.copy(self._folder / name, self._keep_in / name)
        for name in (SUMO_LOOPS, SUMO_DETECTORS, SUMO_DETECTED):
            if (self._folder / name).exists():
                shutil.copy(self._folder / name, self._keep_in / name)
        if self._detectors:
            counts = counted(self._folder / SUMO_DETECTED, self._detectors)
            write_text(self._keep_in / DETECTED, counts.write_csv())
        command = [
            *("sumo", "--net-file", self._network_name, "--route-files", "routes.rou.xml"),
            *("--step-length", repr(self._step_s), "--seed", str(self._seed)),
            *self._loops(),
            *(*PLAIN_OPTIONS, *COLLISION_OPTIONS, "--end", repr(self._cap_s)),
            *self._step_method,
            *self._plan.options,
        ]
        (self._keep_in / SUMO_COMMAND).write_text(" ".join(command) + "\n")

    @property
    def _network_name(self) -> str:
        """A copy's name: a network that is packed stays so."""
        packed = self._plan.file.name.endswith(".gz")
        return f"{SUMO_NETWORK}.gz" if packed else SUMO_NETWORK

    def collisions(self) -> int:
        """Returns how many pairs of vehicles SUMO saw collide."""
        root = ET.parse(self._folder / "collisions.xml").getroot()
        pairs = {(c.get("collider"), c.get("victim")) for c in root.iter("collision")}
        return len(pairs)

    def collided(self, arrivals: Sequence[Arrival]) -> tuple[tuple[float, int, int], ...]:
        """Returns whom SUMO saw collide: time (s), places of rear and front vehicle."""
        number = {arrival.vehicle_id: k for k, arrival in enumerate(arrivals)}
        root = ET.parse(self._folder / "collisions.xml").getroot()
        return tuple(
            (float(c.get("time", "0")), number[c.get("collider", "")], number[c.get("victim", "")])
            for c in root.iter("collision")
        )

    def finished(self, arrivals: Sequence[Arrival]) -> BoolArray:
        """Returns which vehicles left the network, one entry an arrival."""
        root = ET.parse(self._folder / "tripinfo.xml").getroot()
        left = {
            trip.get("id", "")
            for trip in root.iter("tripinfo")
            if float(trip.get("arrival", "-1")) >= 0.0
        }
        return np.array([arrival.vehicle_id in left for arrival in arrivals], np.bool_)

    def samples(self, arrivals: Sequence[Arrival]) -> Samples:
        """Returns all positions, by vehicle and time."""
        spans = self._plan.spans()
        number = {arrival.vehicle_id: k for k, arrival in enumerate(arrivals)}
        starts_m = {lane: span.start_m for lane, span in spans.items()}
        per_m = {lane: span.per_m for lane, span in spans.items()}
        numbers = {lane: span.lane for lane, span in spans.items()}
        lane = pl.col("vehicle_lane")
        written = pl.read_parquet(self._folder / "fcd.parquet")
        if "vehicle_id" not in written.columns:  # nobody ever drove
            nothing = np.empty(0)
            nobody = nothing.astype(np.int64)
            return Samples(nobody, nobody, nothing, nothing, nothing)
        frame = (
            written.lazy()
            .drop_nulls("vehicle_id")
            .select(
                vehicle=pl.col("vehicle_id").replace_strict(number, return_dtype=pl.Int64),
                lane=lane.replace_strict(numbers, return_dtype=pl.Int64),
                time_s="timestep_time",
                station_m=lane.replace_strict(starts_m, return_dtype=pl.Float64)
                + pl.col("vehicle_pos") * lane.replace_strict(per_m, return_dtype=pl.Float64),
                speed_mps="vehicle_speed",
            )
            .sort("vehicle", "time_s")
            .collect()
        )
        return Samples(*(frame[name].to_numpy() for name in frame.columns))
