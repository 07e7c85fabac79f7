"""One SUMO simulation in this process; the only module that imports libsumo.

Time: after ``step_to(n)`` SUMO has executed the steps 0 to n - 1, and vehicles stand where they
are at step n - 1. What is commanded then governs the way from there to step n.
"""

import math
import os
import threading
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from types import TracebackType
from typing import Any, Self

import libsumo as untyped_libsumo
import numpy as np
from libsumo import _libsumo as untyped_native

from coramp._kernel import FloatArray
from coramp.errors import CorampError
from coramp.worlds.sumo.demand import FASTEST_COMMAND_MPS
from coramp.worlds.sumo.network import sumo_binary

libsumo: Any = untyped_libsumo
native: Any = untyped_native
"""libsumo's functions without the Python around each, for what is called for every vehicle."""

OBEY = 32
"""Speed mode without any check: the vehicle does what it is told."""
NO_CHANGES = 0
"""Lane change mode without changes of its own, and without checks of those commanded."""
CLEAR_CHANGES = 256
"""Lane change mode without changes of its own, in which SUMO refuses those that would collide."""
DRIVERS_CARE = 31
"""Speed mode of a driver: with all checks."""
DRIVERS_CHANGES = 1621
"""SUMO's own lane change mode: drivers yield to a vehicle that would like to change."""
GREEN, YELLOW, RED = "G", "y", "r"
ACTION_S = 1.0
"""How often SUMO lets a vehicle that was taken over look around.

In between it keeps its acceleration, which is what its pieces ask for; each command makes it act
at once. That more than halves the time of a simulation step.
"""
TOLD_S = 5.0
"""At most so long is simulated before a session tells how far it is."""


class Session:
    """A running simulation; use it as a context manager."""

    _free = threading.Lock()
    _owner: int | None = None

    def __init__(
        self,
        options: Sequence[str],
        step_s: float,
        gui: bool = False,
        tell: Callable[[float], None] | None = None,
    ) -> None:
        """Starts SUMO; libsumo runs one simulation a process, so other threads wait for it.

        ``tell`` is told, while SUMO runs, the time (s) that is simulated, and infinity at its end.
        """
        if Session._owner == threading.get_ident():
            raise CorampError("SUMO: one simulation a process; the other one still runs")
        if gui and not os.environ.get("DISPLAY"):
            raise CorampError("--gui: there is no screen (DISPLAY is not set); run without --gui")
        self._step_s = step_s
        self._tell = tell
        self._done = 0
        program = sumo_binary("sumo-gui" if gui else "sumo")
        extra = ("--start", "--quit-on-end") if gui else ()
        Session._free.acquire()
        try:
            libsumo.start([program, *options, "--step-length", repr(step_s), *extra])
        except BaseException as error:
            Session._free.release()
            if isinstance(error, libsumo.TraCIException | libsumo.FatalTraCIError):
                raise CorampError(f"SUMO: {error}") from error
            raise
        Session._owner = threading.get_ident()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            libsumo.close()
        finally:
            Session._owner = None
            Session._free.release()
        if self._tell is not None and error is None:
            self._tell(math.inf)

    def step_to(self, step: int) -> None:
        """Executes all steps before ``step``; raises CorampError where SUMO gives up."""
        try:
            if self._tell is not None:
                self._step_telling(step, self._tell)
            libsumo.simulationStep(step * self._step_s)
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise CorampError(f"SUMO: {error}") from error

    def _step_telling(self, step: int, tell: Callable[[float], None]) -> None:
        """Executes steps before ``step``, but not the last, and tells how far it is."""
        for done in range(self._done, step, max(1, round(TOLD_S / self._step_s))):
            if done > self._done:
                libsumo.simulationStep(done * self._step_s)
            tell(done * self._step_s)
        self._done = step

    def step_on(self) -> None:
        """Executes one step."""
        try:
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise CorampError(f"SUMO: {error}") from error

    def still_here(self, names: Sequence[str]) -> list[bool]:
        """Returns which of these vehicles are on the road."""
        here = set(libsumo.vehicle.getIDList())
        return [name in here for name in names]

    def vehicles_left(self) -> int:
        """Returns how many vehicles drive or are still to enter."""
        return int(libsumo.simulation.getMinExpectedNumber())

    def add(
        self, vehicle_id: str, route: str, kind: str, step: int, speed_mps: float, lane: int = 0
    ) -> None:
        """Lets a vehicle enter at ``step`` with its front at the start of a lane of its route."""
        _check_speed(vehicle_id, speed_mps)
        libsumo.vehicle.add(
            vehicle_id,
            route,
            kind,
            depart=repr(round(step * self._step_s, 6)),
            departLane=str(lane),
            departPos="0",
            departSpeed=repr(speed_mps),
        )

    def take_over(self, vehicle_id: str) -> None:
        """Switches off the vehicle's own driver."""
        libsumo.vehicle.setSpeedMode(vehicle_id, OBEY)
        libsumo.vehicle.setLaneChangeMode(vehicle_id, NO_CHANGES)

    def take_over_among_drivers(self, vehicle_id: str) -> None:
        """Commands a vehicle's speed; SUMO still has it ask drivers to make room for it."""
        libsumo.vehicle.setSpeedMode(vehicle_id, OBEY)
        libsumo.vehicle.setLaneChangeMode(vehicle_id, DRIVERS_CHANGES)

    def ask_drivers(self, vehicle_id: str, asks: bool) -> None:
        """Has SUMO ask drivers to make room for a vehicle that was taken over, or no longer."""
        mode = DRIVERS_CHANGES if asks else NO_CHANGES
        libsumo.vehicle.setLaneChangeMode(vehicle_id, mode)

    def force(self, vehicle_id: str, speed_mps: float, time_s: float) -> None:
        """Has a driver change to a speed in his lane, whatever is around him, until released."""
        _check_speed(vehicle_id, speed_mps)
        libsumo.vehicle.setSpeedMode(vehicle_id, OBEY)
        libsumo.vehicle.setLaneChangeMode(vehicle_id, NO_CHANGES)
        libsumo.vehicle.slowDown(vehicle_id, speed_mps, max(time_s, self._step_s))

    def hold(self, vehicle_id: str, speed_mps: float) -> None:
        """Has a driver keep a speed until he is released."""
        _check_speed(vehicle_id, speed_mps)
        libsumo.vehicle.setSpeed(vehicle_id, speed_mps)

    def release(self, vehicle_id: str) -> None:
        """Leaves a vehicle to its driver again; one that has left the road needs nothing."""
        if vehicle_id in libsumo.vehicle.getIDList():
            self.release_here(vehicle_id)

    def release_here(self, vehicle_id: str) -> None:
        """Leaves a vehicle that is on the road to its driver again."""
        libsumo.vehicle.setSpeedMode(vehicle_id, DRIVERS_CARE)
        libsumo.vehicle.setLaneChangeMode(vehicle_id, DRIVERS_CHANGES)
        libsumo.vehicle.setSpeed(vehicle_id, -1.0)

    def judge_gaps_by(self, vehicle_id: str, min_gap_m: float, assertive: float) -> None:
        """Sets by what SUMO judges gaps for a vehicle that would like to change lanes.

        It asks for ``min_gap_m`` behind the vehicle in front, and divides what it asks for behind
        by ``assertive``.
        """
        libsumo.vehicle.setMinGap(vehicle_id, min_gap_m)
        libsumo.vehicle.setParameter(vehicle_id, "laneChangeModel.lcAssertive", repr(assertive))

    def drive_evenly(
        self,
        vehicle_ids: Sequence[str],
        before_mps: FloatArray,
        after_mps: FloatArray,
        steps: int,
    ) -> None:
        """Commands even changes of speed over steps, from the speeds that the last step had.

        Under Euler steps a vehicle goes x = v t + a t^2 / 2 exactly if ``before_mps`` is
        v - a h / 2 and ``after_mps`` v + a (n - 1/2) h for n steps of h. Nobody is commanded if
        one of the speeds cannot be.
        """
        befores, afters = before_mps.tolist(), after_mps.tolist()
        if not _all_can_be(before_mps, after_mps):
            for vehicle_id, before, after in zip(vehicle_ids, befores, afters, strict=True):
                if not math.isfinite(before):
                    raise CorampError(f"SUMO: {vehicle_id}: a speed of {before} m/s cannot be")
                _check_speed(vehicle_id, after)
        set_previous, slow_down = native.vehicle_setPreviousSpeed, native.vehicle_slowDown
        time_s = steps * self._step_s
        for vehicle_id, before, after in zip(vehicle_ids, befores, afters, strict=True):
            set_previous(vehicle_id, before)
            slow_down(vehicle_id, after, time_s)

    def change_lane_now(self, vehicle_id: str, steps: int) -> None:
        """Commands a change to the next lane further in, in the next step, without checks."""
        libsumo.vehicle.setLaneChangeMode(vehicle_id, NO_CHANGES)
        lane = libsumo.vehicle.getLaneIndex(vehicle_id) + 1
        libsumo.vehicle.changeLane(vehicle_id, lane, (steps + 1) * self._step_s)

    def change_lane_if_clear(self, vehicle_id: str, time_s: float) -> None:
        """Commands a change to the next lane further in, but for one into another vehicle."""
        libsumo.vehicle.setLaneChangeMode(vehicle_id, CLEAR_CHANGES)
        lane = libsumo.vehicle.getLaneIndex(vehicle_id) + 1
        libsumo.vehicle.changeLane(vehicle_id, lane, time_s)

    def everyone(self) -> tuple[list[str], list[str], list[float], list[float]]:
        """Returns who is on the road: names, lanes, positions along them (m), speeds (m/s)."""
        names = list(native.vehicle_getIDList())
        return (
            names,
            list(map(native.vehicle_getLaneID, names)),
            list(map(native.vehicle_getLanePosition, names)),
            list(map(native.vehicle_getSpeed, names)),
        )

    def lanes(self) -> set[str]:
        """Returns the names of all lanes of the network."""
        return set(libsumo.lane.getIDList())

    def on_lanes(
        self, lanes: Iterable[str]
    ) -> tuple[list[str], list[int], list[float], list[float]]:
        """Returns who is on these lanes, lane by lane, and how many are on each.

        Names, numbers by lane, positions along the lanes (m), speeds (m/s).
        """
        here = list(map(native.lane_getLastStepVehicleIDs, lanes))
        names = list(chain.from_iterable(here))
        return (
            names,
            list(map(len, here)),
            list(map(native.vehicle_getLanePosition, names)),
            list(map(native.vehicle_getSpeed, names)),
        )

    def keep_speed(self, vehicle_id: str, speed_mps: float) -> None:
        """Commands a speed from now on."""
        _check_speed(vehicle_id, speed_mps)
        libsumo.vehicle.setSpeed(vehicle_id, speed_mps)
        self.act_now(vehicle_id)

    def change_speed(self, vehicle_id: str, speed_mps: float, steps: int) -> None:
        """Commands an even change to a speed over a number of steps."""
        _check_speed(vehicle_id, speed_mps)
        if steps < 1:
            raise CorampError(f"SUMO: {vehicle_id}: cannot change speed over {steps} steps")
        libsumo.vehicle.slowDown(vehicle_id, speed_mps, steps * self._step_s)
        self.act_now(vehicle_id)

    def change_lane(self, vehicle_id: str, lane: int) -> None:
        """Commands a change to a lane, by its index, at the end of the next step.

        For that step alone: on the next edge the same index may be another lane.
        """
        libsumo.vehicle.changeLane(vehicle_id, lane, 0.5 * self._step_s)
        self.act_now(vehicle_id)

    def set_signal(self, signal: str, lane: str, colour: str) -> None:
        """Sets the links of a signal that come from ``lane``; all others stay green."""
        links = libsumo.trafficlight.getControlledLinks(signal)
        state = "".join(colour if link[0][0] == lane else GREEN for link in links)
        libsumo.trafficlight.setRedYellowGreenState(signal, state)

    def since_before(self, step: int) -> list[str]:
        """Returns who is on the road and entered before ``step``."""
        now_s = (step - 0.5) * self._step_s
        everyone: tuple[str, ...] = libsumo.vehicle.getIDList()
        return [name for name in everyone if libsumo.vehicle.getDeparture(name) < now_s]

    def speed_mps(self, vehicle_id: str) -> float:
        """Returns how fast a vehicle on the road is."""
        return float(libsumo.vehicle.getSpeed(vehicle_id))

    def loop_occupancy(self, loop: str) -> float:
        """Returns the share of the last step for which a loop was occupied.

        SUMO's figure for an interval leaves out who still stands on the loop at its end.
        """
        return float(libsumo.inductionloop.getLastStepOccupancy(loop)) / 100.0

    def vehicles_on(self, lane: str) -> set[str]:
        """Returns who is on a lane now."""
        return set(libsumo.lane.getLastStepVehicleIDs(lane))

    def stopping_effort(self, lane: str) -> float:
        """Returns how hard who drives on a lane would have to brake to stop at its end.

        In units of that vehicle's own comfortable braking; the largest of all, 0 for none.
        """
        length_m = float(libsumo.lane.getLength(lane))
        return max(
            (_stopping_effort(name, length_m) for name in libsumo.lane.getLastStepVehicleIDs(lane)),
            default=0.0,
        )

    def act_now(self, vehicle_id: str) -> None:
        """Lets a vehicle act in the next step: it looks anew at the lanes before it."""
        libsumo.vehicle.setActionStepLength(vehicle_id, ACTION_S, True)

    def act_each_step(self, vehicle_id: str) -> None:
        """Lets a vehicle act in each step again."""
        libsumo.vehicle.setActionStepLength(vehicle_id, self._step_s, True)

    def lane_and_position_m(self, vehicle_id: str) -> tuple[str, float]:
        """Returns the lane that the vehicle's front is on, and its position along it (m).

        Raises CorampError if the vehicle is not on the road.
        """
        try:
            return (
                libsumo.vehicle.getLaneID(vehicle_id),
                libsumo.vehicle.getLanePosition(vehicle_id),
            )
        except libsumo.TraCIException as error:
            raise CorampError(f"SUMO: {vehicle_id} is not on the road: {error}") from error


def _stopping_effort(vehicle_id: str, at_m: float) -> float:
    """v^2 / (2 d b), with d the way to a position on the vehicle's lane and b its braking."""
    speed_mps = float(libsumo.vehicle.getSpeed(vehicle_id))
    if speed_mps <= 0.0:
        return 0.0
    left_m = at_m - float(libsumo.vehicle.getLanePosition(vehicle_id))
    braking_mps2 = float(libsumo.vehicle.getDecel(vehicle_id))
    return speed_mps**2 / (2.0 * left_m * braking_mps2) if left_m > 0.0 else math.inf


def _all_can_be(before_mps: FloatArray, after_mps: FloatArray) -> bool:
    """Whether speeds (m/s) before are finite, and those after can be commanded."""
    finite = bool(np.isfinite(before_mps).all())
    return finite and bool(((after_mps >= 0.0) & (after_mps <= FASTEST_COMMAND_MPS)).all())


def _check_speed(vehicle_id: str, speed_mps: float) -> None:
    if not (math.isfinite(speed_mps) and 0.0 <= speed_mps <= FASTEST_COMMAND_MPS):
        raise CorampError(f"SUMO: {vehicle_id}: a speed of {speed_mps} m/s is not to be commanded")
