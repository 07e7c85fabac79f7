"""Runs a scenario in SUMO: cooperative vehicles in closed loop, or SUMO's own drivers."""

import math
import shutil
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.driven import MAINLINE, RAMP
from coramp.coordination.plant import Arrival
from coramp.coordination.service import Service
from coramp.demand.arrivals import arrivals_of
from coramp.errors import CorampError
from coramp.messages.channel import Channel
from coramp.messages.events import Report
from coramp.messages.feed import RequestFeed
from coramp.messages.log import Told
from coramp.metrics.motion import pieces_of_samples
from coramp.records.lanes import first_on_mainline_s, seen_history
from coramp.records.outcome import Outcome, Pieces, until_s
from coramp.records.run_folder import SUMO_COMMAND, SUMO_COPIES, SUMO_LOOPS, SUMO_NETWORK
from coramp.scenarios.model import Drivers, Scenario
from coramp.strategies.base import Decider, is_metered, period_of, steps_of_period
from coramp.vehicles.merge_state import BY_MAINLINE_S
from coramp.worlds.outcomes import (
    cap_step_of,
    cooperative_outcome,
    passages_of,
    step_after,
    step_after_last_exit,
)
from coramp.worlds.sumo.cooperative import CooperativePlant
from coramp.worlds.sumo.demand import cooperative_routes, driver_routes
from coramp.worlds.sumo.metering import Meter, loops
from coramp.worlds.sumo.network import (
    RAMP_LANES,
    RoadPlan,
    driver_road_plan,
    network_file,
    road_plan,
)
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.telling import DriversInSumo, positions_in_sumo, with_answers
from coramp.worlds.sumo.traits import traits_of
from coramp.worlds.telling import reports_of_samples, together

PLAIN_OPTIONS = ("--no-step-log", "true", "--time-to-teleport", "-1", "--collision.action", "warn")
LOOK_S = 60.0
"""How long SUMO runs by itself between two looks at whether it is empty."""
LARGEST_PLAN_ERROR_M = 0.05
"""A run in which SUMO is further off a plan has not kept its promise."""
COLLISION_OPTIONS = ("--collision.mingap-factor", "0", "--collision.check-junctions", "true")


@dataclass(frozen=True)
class Samples:
    """Positions of SUMO's vehicles at its steps, by vehicle and time.

    ``on_mainline`` is False on the ramp and the acceleration lane.
    """

    vehicle: IntArray
    on_mainline: BoolArray
    time_s: FloatArray
    station_m: FloatArray
    speed_mps: FloatArray


@dataclass(frozen=True)
class SumoOptions:
    """How a run is watched: files kept in a folder, a window, messages kept in the outcome."""

    keep_in: Path | None = None
    gui: bool = False
    keep_messages: bool = False


def run_cooperative(
    scenario: Scenario, strategy: Decider, seed: int, options: SumoOptions
) -> Outcome:
    """Returns what happened with cooperative vehicles under a strategy.

    What they drove is known from commands and from where each met its vehicle, as long as SUMO
    keeps to the plan. Where it does not, the run is done again and SUMO's positions are read, so
    that figures of safety are those of what happened. Raises CorampError where SUMO fails, or still
    has vehicles that should have left.
    """
    outcome = _run_cooperative(scenario, strategy, seed, options, sampled=False)
    if np.nanmax(outcome.passages.plan_error_m, initial=0.0) <= LARGEST_PLAN_ERROR_M:
        return outcome
    return _run_cooperative(scenario, strategy, seed, options, sampled=True)


def _run_cooperative(
    scenario: Scenario, strategy: Decider, seed: int, options: SumoOptions, sampled: bool
) -> Outcome:
    rules = scenario.rules()
    arrivals = arrivals_of(scenario, seed)
    plan = road_plan(scenario)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        keep = options.keep_messages
        files = _Files(
            Path(name), scenario, plan, seed, options, ballistic=True, sampled=sampled or keep
        )
        files.write_routes(cooperative_routes(scenario, arrivals, with_vehicles=False))
        with Session(
            [*files.options(), "--insertion-checks", "none"], rules.control.step_s, options.gui
        ) as session:
            plant = CooperativePlant(session, plan.lane_starts_m(), rules)
            channel = Channel(plant)
            coordinator = Coordinator(
                strategy,
                rules,
                RequestFeed(arrivals),
                scenario.fastest_mainline_entry_mps,
                channel if keep else plant,
            )
            cap_step = cap_step_of(scenario)
            coordinator.expect_arrivals()
            coordinator.run(cap_step)
            end_step = min(cap_step, step_after_last_exit(coordinator, rules.control.step_s))
            plant.finish(end_step)
            if end_step < cap_step and session.vehicles_left():
                raise CorampError("SUMO: vehicles are left although every plan has ended")
        if options.keep_in is not None:
            files.write_routes(cooperative_routes(scenario, arrivals, with_vehicles=True))
        files.keep()
        collisions = files.collisions()
        samples = files.samples(arrivals) if sampled or keep else None
    outcome = cooperative_outcome(
        coordinator,
        arrivals,
        rules.control.step_s,
        end_step,
        np.array([vehicle.largest_error_m for vehicle in plant.vehicles]),
        _driven(plant, coordinator.entered()[0], len(arrivals)),
        collisions,
    )
    if samples is None:
        return outcome
    if keep:
        positions = together(
            (
                reports_of_samples(*_motion_of(samples), rules.control.step_s),
                positions_in_sumo(plant, outcome.vehicle_of_row, rules.control.step_s),
            )
        )
        told = Told(arrivals, channel.commands, positions, (), end_step)
        outcome = replace(outcome, told=told)
    return _as_seen(outcome, samples) if sampled else outcome


def _motion_of(samples: Samples) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    return samples.vehicle, samples.time_s, samples.station_m, samples.speed_mps


def _as_seen(outcome: Outcome, samples: Samples) -> Outcome:
    """Returns the outcome with what vehicles drove as SUMO's positions have it, at each step."""
    vehicles = len(outcome.passages)
    first, rows = pieces_of_samples(*_motion_of(samples), vehicles)
    last_s = np.full(vehicles, np.nan)
    last_s[samples.vehicle] = samples.time_s  # the last one of each vehicle stays
    lanes = seen_history(samples.vehicle, samples.on_mainline, samples.time_s, last_s)
    return replace(outcome, driven=Pieces(first, rows), lanes=lanes)


def _driven(plant: CooperativePlant, vehicle_of_row: IntArray, vehicles: int) -> Pieces:
    """What vehicles drove in SUMO: from each command and where it met them, by vehicle and time."""
    rows = np.array(plant.driven, dtype=np.float64).reshape(-1, 5)
    vehicle = vehicle_of_row[rows[:, 0].astype(np.int64)]
    order = np.argsort(vehicle, kind="stable")
    first = np.searchsorted(vehicle[order], np.arange(vehicles + 1)).astype(np.int64)
    return Pieces(first, np.ascontiguousarray(rows[order, 1:]))


def run_uncontrolled(
    scenario: Scenario, strategy: Decider, drivers: Drivers, seed: int, options: SumoOptions
) -> Outcome:
    """Returns what happened with SUMO's own drivers on the same arrivals, metered or not.

    They report and are never commanded; the loop is that of cooperative runs.
    """
    arrivals = arrivals_of(scenario, seed)
    metered = is_metered(strategy)
    plan = driver_road_plan(scenario, drivers, metered)
    step_s, cap_step = scenario.control.step_s, cap_step_of(scenario)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        ballistic = drivers.integrator == "ballistic"
        files = _Files(Path(name), scenario, plan, seed, options, ballistic, sampled=True)
        traits = traits_of(drivers, arrivals, seed)
        files.write_routes(driver_routes(scenario, drivers, arrivals, traits, metered))
        look_steps = steps_of_period(period_of(strategy) or LOOK_S, step_s)
        if metered:
            files.write_loops(loops(scenario, look_steps * step_s))
        with Session(files.options(), step_s, options.gui) as session:
            road = DriversInSumo(session, plan.lane_starts_m(), step_s)
            meter = Meter(session, step_s) if metered else None
            service = Service(
                strategy, scenario.rules(), scenario.fastest_mainline_entry_mps, road.ask
            )
            _let_drive(session, service, road, meter, look_steps, cap_step)
        files.keep()
        samples, finished = files.samples(arrivals), files.finished()
        collisions = files.collisions()
    entry_s, exit_s = _passing_times(samples, arrivals, finished, scenario.mainline.end_m, step_s)
    first, rows = pieces_of_samples(
        samples.vehicle, samples.time_s, samples.station_m, samples.speed_mps, len(arrivals)
    )
    left = not np.isnan(exit_s).any()
    no_plan = np.full(len(arrivals), np.nan)
    end_s = float(np.max(exit_s, initial=0.0)) if left else cap_step * step_s
    lanes = seen_history(
        samples.vehicle, samples.on_mainline, samples.time_s, until_s(exit_s, end_s)
    )
    merge_s = first_on_mainline_s(lanes, len(arrivals))
    merge_s[[not arrival.on_ramp for arrival in arrivals]] = BY_MAINLINE_S
    told = None
    if options.keep_messages:
        last_s = end_s if left else math.inf
        end_step = min(cap_step, step_after(last_s, step_s))
        told = _told_of_drivers(arrivals, samples, road.told, meter, step_s, end_step)
    return Outcome(
        cooperative=False,
        passages=passages_of(arrivals, step_s, entry_s, merge_s, exit_s, no_plan),
        pieces=Pieces(first, rows),
        lane=np.where(samples.on_mainline, MAINLINE, RAMP),
        driven=Pieces(first, rows),
        lanes=lanes,
        end_s=end_s,
        collisions=collisions,
        refusals=tuple(service.coordinator.refusals),
        interventions=service.coordinator.interventions,
        told=told,
    )


def _let_drive(
    session: Session,
    service: Service,
    road: DriversInSumo,
    meter: Meter | None,
    look_steps: int,
    cap_step: int,
) -> None:
    """Lets SUMO run until it is empty; tells the service so far each ``look_steps``, and obeys."""
    step = 0
    while step < cap_step and (step == 0 or session.vehicles_left()):
        until = min(cap_step, step + look_steps)
        readings = [] if meter is None else [meter.read(step, until)]
        session.step_to(until)
        road.now_step = step = until
        commands = service.handle(readings, step)
        if meter is not None:
            meter.obey(commands, step)


def _told_of_drivers(
    arrivals: Sequence[Arrival],
    samples: Samples,
    answers: Sequence[Report],
    meter: Meter | None,
    step_s: float,
    end_step: int,
) -> Told:
    """Returns the messages of a run of drivers, who are reported and never commanded."""
    number = {arrival.vehicle_id: k for k, arrival in enumerate(arrivals)}
    positions = reports_of_samples(*_motion_of(samples), step_s)
    positions = with_answers(positions, answers, number, step_s)
    if meter is None:
        return Told(arrivals, [], positions, [], end_step)
    signals = [signal for signal in meter.signals if signal.step <= end_step]
    readings = [r for r in meter.readings if round(r.time_s / step_s) <= end_step]
    return Told(arrivals, signals, positions, readings, end_step)


def _passing_times(
    samples: Samples,
    arrivals: Sequence[Arrival],
    finished: set[str],
    end_m: float,
    step_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Entry and exit of each vehicle; its last sample is run on to the zone's end."""
    entry_s, exit_s = (np.full(len(arrivals), np.nan) for _ in range(2))
    seen, first = np.unique(samples.vehicle, return_index=True)
    last = np.append(first[1:], len(samples.vehicle))[: len(first)] - 1
    entry_s[seen] = samples.time_s[first]
    left_m = end_m - samples.station_m[last]
    run_on_s = np.minimum(left_m / np.maximum(samples.speed_mps[last], 1e-9), step_s)
    exit_s[seen] = samples.time_s[last] + run_on_s
    done = np.array([arrival.vehicle_id in finished for arrival in arrivals], np.bool_)
    return entry_s, np.where(done, exit_s, np.nan)


class _Files:
    """The files of one run in a folder of its own, and what is read from them."""

    def __init__(
        self,
        folder: Path,
        scenario: Scenario,
        plan: RoadPlan,
        seed: int,
        options: SumoOptions,
        ballistic: bool,
        sampled: bool = False,
    ) -> None:
        self._folder = folder
        self._plan = plan
        self._step_s = scenario.control.step_s
        self._seed = seed
        self._keep_in = options.keep_in
        self._ballistic = ballistic
        self._sampled = sampled
        self._cap_s = scenario.simulation.horizon_s + scenario.simulation.drain_s

    def write_routes(self, text: str) -> None:
        (self._folder / "routes.rou.xml").write_text(text)

    def write_loops(self, text: str) -> None:
        (self._folder / SUMO_LOOPS).write_text(text)

    def _loops(self, name: Path) -> list[str]:
        return ["--additional-files", str(name)] if (self._folder / SUMO_LOOPS).exists() else []

    def options(self) -> list[str]:
        """Returns SUMO's options, output files included."""
        folder = self._folder
        result = [
            *("--net-file", str(network_file(self._plan))),
            *("--route-files", str(folder / "routes.rou.xml")),
            *("--seed", str(self._seed), *PLAIN_OPTIONS, *COLLISION_OPTIONS),
            *("--no-warnings", "true", "--collision-output", str(folder / "collisions.xml")),
            *self._loops(folder / SUMO_LOOPS),
        ]
        if self._ballistic:
            result.append("--step-method.ballistic")
        if self._sampled or self._keep_in is not None:
            result += ["--fcd-output", str(folder / "fcd.parquet"), "--precision", "4"]
            result += ["--tripinfo-output", str(folder / "tripinfo.xml")]
        if self._keep_in is None:
            result += ["--fcd-output.attributes", "lane,pos,speed"] if self._sampled else []
        else:
            result += ["--tripinfo-output.write-unfinished", "--tripinfo-output.write-undeparted"]
        return result

    def keep(self) -> None:
        """Copies the files to where they are to be kept, with a command that uses them."""
        if self._keep_in is None:
            return
        self._keep_in.mkdir(parents=True, exist_ok=True)
        shutil.copy(network_file(self._plan), self._keep_in / SUMO_NETWORK)
        for name in SUMO_COPIES:
            shutil.copy(self._folder / name, self._keep_in / name)
        if self._loops(Path(SUMO_LOOPS)):
            shutil.copy(self._folder / SUMO_LOOPS, self._keep_in / SUMO_LOOPS)
        command = [
            *("sumo", "--net-file", SUMO_NETWORK, "--route-files", "routes.rou.xml"),
            *("--step-length", repr(self._step_s), "--seed", str(self._seed)),
            *self._loops(Path(SUMO_LOOPS)),
            *(*PLAIN_OPTIONS, *COLLISION_OPTIONS, "--end", repr(self._cap_s)),
            *(("--step-method.ballistic",) if self._ballistic else ()),
        ]
        (self._keep_in / SUMO_COMMAND).write_text(" ".join(command) + "\n")

    def collisions(self) -> int:
        """Returns how many pairs of vehicles SUMO saw collide."""
        root = ET.parse(self._folder / "collisions.xml").getroot()
        pairs = {(c.get("collider"), c.get("victim")) for c in root.iter("collision")}
        return len(pairs)

    def finished(self) -> set[str]:
        """Returns the vehicles that left the network."""
        root = ET.parse(self._folder / "tripinfo.xml").getroot()
        return {
            trip.get("id", "")
            for trip in root.iter("tripinfo")
            if float(trip.get("arrival", "-1")) >= 0.0
        }

    def samples(self, arrivals: Sequence[Arrival]) -> Samples:
        """Returns all positions, by vehicle and time."""
        starts_m = self._plan.lane_starts_m()
        number = {arrival.vehicle_id: k for k, arrival in enumerate(arrivals)}
        on_mainline = {lane: lane not in RAMP_LANES for lane in starts_m}
        lane = pl.col("vehicle_lane")
        written = pl.read_parquet(self._folder / "fcd.parquet")
        if "vehicle_id" not in written.columns:  # nobody ever drove
            nothing = np.empty(0)
            return Samples(nothing.astype(np.int64), nothing.astype(np.bool_), *[nothing] * 3)
        frame = (
            written.lazy()
            .drop_nulls("vehicle_id")
            .select(
                vehicle=pl.col("vehicle_id").replace_strict(number, return_dtype=pl.Int64),
                on_mainline=lane.replace_strict(on_mainline, return_dtype=pl.Boolean),
                time_s="timestep_time",
                station_m=lane.replace_strict(starts_m, return_dtype=pl.Float64)
                + pl.col("vehicle_pos"),
                speed_mps="vehicle_speed",
            )
            .sort("vehicle", "time_s")
            .collect()
        )
        return Samples(*(frame[name].to_numpy() for name in frame.columns))
