"""Scenarios: a road, its vehicles, its traffic and its controller, as validated TOML.

All numbers are SI. Unknown keys, wrong types, nan and infinity are refused, and so is what cannot
work together. ``--set key=value`` takes the same dotted keys.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    field_validator,
    model_validator,
)

from coramp.equations.conflict_risk import GRAVITY_MPS2
from coramp.equations.ramp_acceleration import lag_m
from coramp.equations.safe_distance import braking_distance_m
from coramp.road.rules import Control, MotionLimits, Road, Rules, SafetyBudget, Traffic
from coramp.scenarios.checks import problems_of
from coramp.scenarios.stations import chosen_decision_station_m
from coramp.scenarios.vehicle_types import VehicleType
from coramp.strategies.parameters import Value
from coramp.vehicles.traits import CAR, Traits

FASTEST_MPS = 60.0
NEAREST_STOP_M = -1.0
SIGNAL_STATION_M = -60.0
REACTION_S = 1.0
LONGEST_STEP_S = 0.25
"""Up to here SUMO was seen to stay within 5 cm of the plan; the error grows with the square."""
SURE_STEP_S, SPEED_DRIFT_MPS2 = 0.1, 1.0
"""With longer steps SUMO was seen to be faster than planned by 0.62 m/s2 times the step."""
SLOWER_PER_TIME_GAP_PS = 4.0
"""By how many times ``speed_deviation`` a gap maker may be slower still, a second of time gap."""
SLOWEST_DEVIATION = 0.5
"""Slower still gains nothing: flows at breakdown are the same, and the mainline loses more."""
GRIP_SHARE = 0.95
"""Of the braking that Eq. 3 allows, what stops before the nose use."""


class Model(BaseModel):
    """Frozen, strict, and without room for keys that nobody reads."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


Speed = Annotated[float, Field(gt=0.0, le=FASTEST_MPS)]
SpeedRange = Annotated[tuple[Speed, Speed], Field(strict=False)]
Flow = Annotated[float, Field(ge=0.0)]
Headway = Annotated[float, Field(gt=0.0, le=60.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


def _one_or_list(value: Any) -> str:
    return "(list)" if isinstance(value, list | tuple) else "(one)"


class Stream(Model):
    """Where vehicles come from, how fast and how many.

    With ``flow_to_veh_h`` the flow changes evenly, from ``flow_veh_h`` at the start to it at the
    horizon.
    """

    start_m: Annotated[float, Field(lt=0.0, ge=-20000.0)]
    speed_mps: Speed
    limit_mps: Speed
    entry_speed_mps: SpeedRange
    flow_veh_h: Flow
    flow_to_veh_h: Flow | None = None
    min_headway_s: Headway = 0.6

    @property
    def flows_veh_h(self) -> tuple[float, float]:
        """The flow at the start and at the horizon."""
        end = self.flow_veh_h if self.flow_to_veh_h is None else self.flow_to_veh_h
        return self.flow_veh_h, end


class Mainline(Stream):
    """The mainline lane of the control zone; station 0 is the end of the ramp."""

    end_m: Annotated[float, Field(gt=0.0, le=20000.0)]


class Ramp(Stream):
    """The ramp, which ends at station 0, and the acceleration lane behind it.

    ``decision_station_m`` is where a vehicle is planned; left out, it is early among the stations
    at which that is possible. ``stop_station_m`` is where a vehicle stops that has no merge yet;
    left out, it is as near to the nose as still lets it reach v0 in time from a stand.
    ``detector_station_m`` is that of the mainline's loop for ramp metering; left out, it is three
    quarters along the lane. ``signal_station_m`` is that of its stop line; left out, it is 60 m
    before the nose, or a quarter of a shorter ramp, so that who was stopped can speed up before it
    merges.
    """

    acceleration_lane_m: Annotated[float, Field(gt=0.0, le=5000.0)]
    merge_angle_deg: Annotated[float, Field(ge=0.0, lt=90.0)] = 30.0
    decision_station_m: Annotated[float, Field(lt=0.0)] | None = None
    stop_station_m: Annotated[float, Field(lt=0.0)] | None = None
    detector_station_m: Annotated[float, Field(gt=0.0)] | None = None
    signal_station_m: Annotated[float, Field(le=-1.0)] | None = None


class Vehicle(Model):
    """All vehicles are cars and alike; an explicit arrival may be longer or shorter."""

    length_m: Annotated[float, Field(gt=0.0, le=40.0)] = 5.0


Vehicles = Annotated[
    Annotated[Vehicle, Tag("(one)")]
    | Annotated[tuple[VehicleType, ...], Field(strict=False, min_length=1), Tag("(list)")],
    Discriminator(_one_or_list),
]
"""Either ``[vehicle]``, where all are alike, or ``[[vehicle]]``, a table for each type."""


class Safety(Model):
    """The error budget of Eq. 1, and what planning adds to it."""

    positioning_error_m: Annotated[float, Field(ge=0.0, le=20.0)] = 0.02
    clock_error_s: Annotated[float, Field(ge=0.0, le=1.0)] = 3e-9
    adhesion: Annotated[float, Field(gt=0.0, le=2.0)] = 0.4
    resistance: Annotated[float, Field(ge=0.0, le=1.0)] = 0.11
    time_gap_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    standstill_gap_m: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0
    execution_allowance_m: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1


class Motion(Model):
    """How hard vehicles accelerate and brake, and how far speed may leave v0 for a gap."""

    speed_up_mps2: Annotated[float, Field(gt=0.0, le=10.0)] = 1.5
    slow_down_mps2: Annotated[float, Field(gt=0.0, le=10.0)] = 2.0
    comfort_mps2: Annotated[float, Field(gt=0.0, le=10.0)] = 0.3 * GRAVITY_MPS2
    free_acceleration_mps2: Annotated[float, Field(gt=0.0, le=10.0)] = 2.0
    ramp_acceleration_mps2: Annotated[float, Field(gt=0.0, le=10.0)] = 6.0
    speed_deviation: Annotated[float, Field(ge=0.0, le=0.5)] = 0.1
    slow_deviation: Annotated[float, Field(ge=0.0, le=0.9)] | None = None
    slowest_ramp_speed_mps: Speed = 2.0


class Controller(Model):
    """The control clock and the readings of the paper that are open to choice."""

    step_s: Annotated[float, Field(ge=0.01, le=LONGEST_STEP_S)] = 0.1
    actuation_delay_s: Annotated[float, Field(ge=0.0, le=5.0)] = 0.1
    retry_s: Annotated[float, Field(gt=0.0, le=60.0)] = 0.5
    gap_position: Literal["nearest", "front"] = "nearest"
    gap_creation_start: Literal["decision", "nose"] = "decision"


class SpeedFactor(Model):
    """A normal distribution, cut off at both ends, of what drivers wish over the common speed."""

    mean: Annotated[float, Field(gt=0.0, le=2.0)]
    deviation: Annotated[float, Field(gt=0.0, le=1.0)]
    low: Annotated[float, Field(gt=0.0, le=2.0)]
    high: Annotated[float, Field(gt=0.0, le=2.0)]


DriverGap = Annotated[float, Field(gt=0.0, le=10.0)]
DriverGaps = Annotated[
    Annotated[DriverGap, Tag("(one)")]
    | Annotated[tuple[DriverGap, ...], Field(strict=False, min_length=1), Tag("(list)")],
    Discriminator(_one_or_list),
]


class Drivers(Model):
    """A population of ordinary drivers for uncontrolled runs, in SUMO's terms.

    ``wish`` is the speed that each seeks: its own entry speed everywhere, or v_R0 on the ramp and
    v0 from there on, times its ``speed_factor`` if there is one. ``tau_s`` is one time gap for
    all, or a list of equally likely ones. ``accel_mps2`` is SUMO's own if left out.
    ``car_following`` is SUMO's model; ``sigma`` counts for Krauss alone.
    """

    wish: Literal["entry-speed", "free-flow"]
    speed_factor: SpeedFactor | None = None
    accel_mps2: Annotated[float, Field(gt=0.0, le=10.0)] | None = None
    sigma: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    tau_s: DriverGaps = 1.0
    min_gap_m: Annotated[float, Field(ge=0.0, le=20.0)] = 2.5
    lc_cooperative: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    car_following: Literal["Krauss", "IDM", "EIDM", "ACC", "CACC"] = "Krauss"
    integrator: Literal["euler", "ballistic"] = "euler"

    @property
    def taus_s(self) -> tuple[float, ...]:
        """The time gaps that drivers keep, equally likely."""
        return self.tau_s if isinstance(self.tau_s, tuple) else (self.tau_s,)


class ExplicitArrival(Model):
    """One vehicle of a given list of arrivals; times lie on the step grid.

    Left out, ``type`` is the first type of the scenario, and ``top_speed_mps`` the mean of its own.
    """

    stream: Literal["mainline", "ramp"]
    time_s: NotNegative
    speed_mps: Speed
    length_m: Annotated[float, Field(gt=0.0, le=40.0)] | None = None
    type: str | None = None
    top_speed_mps: Speed | None = None


class Simulation(Model):
    """How long vehicles arrive, and how long a run may go on after that until it is empty."""

    horizon_s: Annotated[float, Field(gt=0.0, le=86400.0)] = 1800.0
    drain_s: Annotated[float, Field(gt=0.0, le=86400.0)] = 1800.0


class Scenario(Model):
    """Everything about a run but its strategy, drivers, flows' overrides and seed.

    ``strategy`` holds parameters of strategies by name: ``[strategy.alinea]``.
    """

    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    mainline: Mainline
    ramp: Ramp
    vehicle: Vehicles = Vehicle()
    safety: Safety = Safety()
    motion: Motion = Motion()
    control: Controller = Controller()
    drivers: dict[str, Drivers] = {}
    simulation: Simulation = Simulation()
    arrivals: Annotated[tuple[ExplicitArrival, ...], Field(strict=False)] = ()
    strategy: dict[str, dict[str, Value]] = {}

    @field_validator("strategy", mode="before")
    @classmethod
    def _finite_parameters(cls, strategies: Any) -> Any:
        """Tells in one line what the kinds of values would each tell in a line of their own."""
        for name, settings in strategies.items() if isinstance(strategies, dict) else ():
            for key, value in settings.items() if isinstance(settings, dict) else ():
                if isinstance(value, float) and not math.isfinite(value):
                    raise ValueError(
                        f"strategy.{name}.{key}: {value} cannot be; allowed are finite numbers"
                    )
        return strategies

    @model_validator(mode="after")
    def _works_together(self) -> Self:
        if problems := problems_of(self):
            raise ValueError("\n".join(problems))
        return self

    @property
    def vehicle_types(self) -> tuple[VehicleType, ...]:
        """The types of vehicles; one car where all are alike."""
        if isinstance(self.vehicle, Vehicle):
            return (VehicleType(name=CAR, share=1.0, length_m=self.vehicle.length_m),)
        return self.vehicle

    def type_named(self, name: str) -> VehicleType:
        """Returns the type of that name, the first one for one that the scenario does not have."""
        return next((t for t in self.vehicle_types if t.name == name), self.vehicle_types[0])

    @property
    def usual_length_m(self) -> float:
        """The length (m) of the type that most vehicles of the mainline have."""
        return max(self.vehicle_types, key=lambda kind: kind.share_of(False)).length_m

    @property
    def longest_m(self) -> float:
        """The length (m) of the longest type."""
        return max(kind.length_m for kind in self.vehicle_types)

    @property
    def vehicles_differ(self) -> bool:
        """Whether planners must look at each vehicle's own limits, not at its length alone."""
        limited = any(arrival.top_speed_mps is not None for arrival in self.arrivals)
        return limited or not all(kind.is_usual for kind in self.vehicle_types)

    def usual_traits(self, length_m: float) -> Traits:
        """Returns the traits of a vehicle that only the common limits bind."""
        safety = self.safety
        return Traits(length_m, safety.positioning_error_m, safety.clock_error_s, safety.time_gap_s)

    @property
    def _traffic(self) -> Traffic:
        """How unlike vehicles are, and by how much more than usual two may need of each other."""
        if not self.vehicles_differ:
            return Traffic()
        usual, fastest_mps = self.usual_traits(0.0), FASTEST_MPS
        own = [kind.traits(usual, math.inf) for kind in self.vehicle_types]
        errors_m = max(t.positioning_error_m for t in own) - usual.positioning_error_m
        clock_s = max(t.clock_error_s for t in own) - usual.clock_error_s
        gap_s = max(t.time_gap_s for t in own) - usual.time_gap_s
        seconds = 2.0 * max(0.0, clock_s) + max(0.0, gap_s)
        return Traffic(True, 2.0 * max(0.0, errors_m) + seconds * fastest_mps)

    def rules(self) -> Rules:
        """Returns what planners are bound by."""
        return self.rules_with(self.decision_station_m)

    def rules_with(self, decision_station_m: float) -> Rules:
        """Returns what planners are bound by, with decisions at a station."""
        return Rules(
            Road(
                mainline_start_m=self.mainline.start_m,
                mainline_end_m=self.mainline.end_m,
                ramp_start_m=self.ramp.start_m,
                decision_station_m=decision_station_m,
                stop_station_m=self.stop_station_m,
                acceleration_lane_m=self.ramp.acceleration_lane_m,
                last_merge_station_m=self.last_merge_station_m,
                mainline_speed_mps=self.mainline.speed_mps,
                ramp_speed_mps=self.ramp.speed_mps,
                ramp_limit_mps=self.ramp.limit_mps,
                merge_angle_rad=math.radians(self.ramp.merge_angle_deg),
            ),
            SafetyBudget(**self.safety.model_dump()),
            MotionLimits(
                stop_mps2=self.stop_mps2,
                **{**self.motion.model_dump(), "slow_deviation": self.slow_deviation},
            ),
            Control(
                step_s=self.control.step_s,
                actuation_delay_s=self.control.actuation_delay_s,
                retry_s=self.control.retry_s,
                gap_at_front=self.control.gap_position == "front",
                create_from_nose=self.control.gap_creation_start == "nose",
            ),
            self._traffic,
        )

    @property
    def last_merge_station_m(self) -> float:
        """The last station of a merge: a step's travel, and half a metre, before the lane ends."""
        return self.ramp.acceleration_lane_m - self.mainline.speed_mps * self.control.step_s - 0.5

    @property
    def decision_station_m(self) -> float:
        """Where ramp vehicles are planned: as given, or as suits the speeds."""
        given = self.ramp.decision_station_m
        return chosen_decision_station_m(self) if given is None else given

    @property
    def stop_station_m(self) -> float:
        """Where ramp vehicles stop: as given, or as near to the nose as a restart allows.

        From there ``speed_up`` must bring a vehicle to the least speed at the nose with which the
        largest acceleration reaches v0 on the acceleration lane: v^2 = v0^2 - 2 a S_a.
        """
        if self.ramp.stop_station_m is not None:
            return self.ramp.stop_station_m
        return min(NEAREST_STOP_M, -self.run_up_m - 0.1)

    @property
    def detector_station_m(self) -> float:
        """Station of the loop on the mainline beside the acceleration lane."""
        given = self.ramp.detector_station_m
        return 0.75 * self.ramp.acceleration_lane_m if given is None else given

    @property
    def signal_station_m(self) -> float:
        """Station of the stop line of ramp metering."""
        given = self.ramp.signal_station_m
        return max(SIGNAL_STATION_M, 0.25 * self.ramp.start_m) if given is None else given

    @property
    def signal_problem(self) -> str:
        """What keeps the ramp from being metered: who enters must be able to stop at the line."""
        speed_mps = self.ramp.limit_mps
        braking_m = 0.5 * speed_mps**2 / self.motion.comfort_mps2
        first_m = self.ramp.start_m + speed_mps * REACTION_S + braking_m
        if self.signal_station_m >= first_m:
            return ""
        return (
            f"ramp.signal_station_m: {self.signal_station_m:g} is too near to the ramp's start to "
            f"stop at; allowed is {first_m:.1f} to -1 m"
        )

    @property
    def drift_problem(self) -> str:
        """What keeps a run in SUMO from being sure: drift that the allowance does not cover.

        Inside a step with a knot, and while it is brought back, a vehicle is faster than planned by
        up to 1 m/s2 times the step, so that a time gap asks for so much more (m). With steps of up
        to 0.1 s the allowance was always seen to cover it.
        """
        step_s, gap_s = self.control.step_s, self.safety.time_gap_s
        needed_m = SPEED_DRIFT_MPS2 * step_s * gap_s
        if step_s <= SURE_STEP_S or self.safety.execution_allowance_m >= needed_m:
            return ""
        return (
            f"safety.execution_allowance_m: {self.safety.execution_allowance_m:g} does not cover "
            f"what SUMO drifts at control.step_s {step_s:g} and safety.time_gap_s {gap_s:g}; "
            f"allowed is at least {needed_m:g} m, or a step of up to {SURE_STEP_S:g} s"
        )

    @property
    def stop_mps2(self) -> float:
        """How hard (m/s2) a vehicle brakes towards a stop: comfortably, and as Eq. 3 allows.

        Behind a standing vehicle Eq. 3 asks for v^2 / (2 g (phi + psi)): whoever brakes harder
        than g (phi + psi) comes too near.
        """
        grip_mps2 = 0.5 / braking_distance_m(1.0, self.safety.adhesion, self.safety.resistance)
        return min(self.motion.comfort_mps2, GRIP_SHARE * grip_mps2)

    @property
    def slow_deviation(self) -> float:
        """Share of v0 by which a vehicle that makes a gap may fall below v0, as given or as fits.

        Room for one vehicle takes the way of a time gap more than by the paper's distances.
        """
        if self.motion.slow_deviation is not None:
            return self.motion.slow_deviation
        deviation = self.motion.speed_deviation
        gap_s = self.safety.time_gap_s + self.safety.standstill_gap_m / self.mainline.speed_mps
        wider = deviation * (1.0 + SLOWER_PER_TIME_GAP_PS * gap_s)
        return max(deviation, min(wider, SLOWEST_DEVIATION))

    @property
    def run_up_m(self) -> float:
        """The way (m) that a standing ramp vehicle needs before the nose to reach v0 in time."""
        v0, most = self.mainline.speed_mps, self.motion.ramp_acceleration_mps2
        nose_square = v0 * v0 - 2.0 * most * self.last_merge_station_m
        return max(0.0, 0.5 * nose_square / self.motion.speed_up_mps2)

    @property
    def mainline_free_flow_s(self) -> float:
        """Time through the zone at v0."""
        return (self.mainline.end_m - self.mainline.start_m) / self.mainline.speed_mps

    @property
    def ramp_free_flow_s(self) -> float:
        """Time along the ramp at v_R0, up to v0 as in free movement, and on to the zone's end."""
        v0, ramp_mps = self.mainline.speed_mps, self.ramp.speed_mps
        lag = lag_m(v0, ramp_mps, self.motion.free_acceleration_mps2)
        return -self.ramp.start_m / ramp_mps + (self.mainline.end_m + lag) / v0

    @property
    def fastest_mainline_entry_mps(self) -> float:
        """The highest speed at which a mainline vehicle may enter."""
        given = [a.speed_mps for a in self.arrivals if a.stream == "mainline"]
        return max(given, default=self.mainline.entry_speed_mps[1])
