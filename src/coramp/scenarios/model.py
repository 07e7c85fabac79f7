"""Scenarios: a road, its vehicles, its traffic and its controller, as validated TOML.

All numbers are SI. Unknown keys, wrong types, nan and infinity are refused, and so is what cannot
work together. ``--set key=value`` takes the same dotted keys.
"""

import math
from typing import Annotated, Any, Self

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from coramp.equations.ramp_acceleration import lag_m
from coramp.equations.safe_distance import braking_distance_m
from coramp.errors import CorampError
from coramp.road.rules import Control, MotionLimits, Road, Rules, SafetyBudget, Traffic
from coramp.scenarios.checks import problems_of
from coramp.scenarios.demand_sections import CountsFile, DemandPart, Detector
from coramp.scenarios.network_section import NetworkSection
from coramp.scenarios.quantities import FASTEST_MPS
from coramp.scenarios.sections import (
    Controller,
    DriverPopulation,
    ExplicitArrival,
    Mainline,
    Model,
    Motion,
    Ramp,
    Safety,
    Simulation,
    TrafficMix,
    Vehicle,
    Vehicles,
)
from coramp.scenarios.stations import chosen_decision_station_m
from coramp.scenarios.vehicle_types import VehicleType
from coramp.scenarios.world_sections import (
    TABLES,
    Actuators,
    Behaviour,
    Clock,
    CommandLink,
    Incidents,
    Positioning,
    ReportLink,
    RoadSurface,
    World,
)
from coramp.strategies.parameters import Value
from coramp.vehicles.traits import CAR, Traits

NEAREST_STOP_M = -1.0
SIGNAL_STATION_M, LAST_SIGNAL_M = -60.0, -1.0
REACTION_S = 1.0
SURE_STEP_S, SPEED_DRIFT_MPS2 = 0.1, 1.0
"""With longer steps SUMO was seen to be faster than planned by 0.62 m/s2 times the step."""
SLOWER_PER_TIME_GAP_PS = 4.0
"""By how many times ``speed_deviation`` a gap maker may be slower still, a second of time gap."""
SLOWEST_DEVIATION = 0.5
"""Slower still gains nothing: flows at breakdown are the same, and the mainline loses more."""
OF_LANES = ("lanes", "lane_shares")
"""Keys of the mainline that say something where it has several lanes."""
GRIP_SHARE = 0.95
"""Of the braking that Eq. 3 allows, what stops before the nose use."""


class Scenario(Model):
    """Everything about a run but its strategy, drivers, flows' overrides and seed.

    ``strategy`` holds parameters of strategies by name: ``[strategy.alinea]``.
    """

    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    mainline: Mainline
    ramp: Ramp
    network: NetworkSection | None = None
    vehicle: Vehicles = Vehicle()
    safety: Safety = Safety()
    motion: Motion = Motion()
    control: Controller = Controller()
    drivers: dict[str, DriverPopulation] = Field(default_factory=dict)
    simulation: Simulation = Simulation()
    arrivals: Annotated[tuple[ExplicitArrival, ...], Field(strict=False)] = ()
    strategy: dict[str, dict[str, Value]] = Field(default_factory=dict)
    traffic: TrafficMix = TrafficMix()
    world: World = World()
    positioning: Positioning = Positioning()
    clock: Clock = Clock()
    reports: ReportLink = ReportLink()
    commands: CommandLink = CommandLink()
    actuators: Actuators = Actuators()
    road: RoadSurface = RoadSurface()
    behaviour: Behaviour = Behaviour()
    incidents: Incidents = Incidents()
    demand: Annotated[tuple[DemandPart, ...], Field(strict=False)] = ()
    counts: CountsFile | None = None
    detector: Annotated[tuple[Detector, ...], Field(strict=False)] = ()

    @model_serializer(mode="wrap")
    def _without_what_is_not_used(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """A scenario without these tables is written, and hashed, as if there were no such.

        So is one with one lane.
        """
        data: dict[str, Any] = handler(self)
        for name in ("network", "demand", "counts", "detector"):
            if not data.get(name):
                data.pop(name, None)
        if self.mainline.lanes == 1:
            data["mainline"] = {k: v for k, v in data["mainline"].items() if k not in OF_LANES}
        return data

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

    def type_named(self, name: str | None) -> VehicleType:
        """Returns the type of that name, the first one for None; CorampError if it is not known."""
        found = [kind for kind in self.vehicle_types if name in (None, kind.name)]
        if not found:
            known = ", ".join(kind.name for kind in self.vehicle_types)
            raise CorampError(f"vehicle type {name!r} is not known; allowed is {known}")
        return found[0]

    @property
    def usual_length_m(self) -> float:
        """The length (m) of the type that most vehicles of the mainline have."""
        return max(self.vehicle_types, key=lambda kind: kind.share_of(False)).length_m

    def automated_share_of(self, type_name: str, on_ramp: bool) -> float:
        """Returns which share of a type's vehicles on a stream is automated."""
        own = self.type_named(type_name).automated_share
        return self.traffic.share_of(on_ramp) if own is None else own

    @property
    def gives_shares(self) -> bool:
        """Whether it says which share is automated: of all vehicles, of a stream or of a type."""
        of_types = (kind.automated_share is not None for kind in self.vehicle_types)
        return self.traffic.gives_shares or any(of_types)

    @property
    def is_mixed(self) -> bool:
        """Whether some vehicle of this scenario may have a driver."""
        kinds = [(kind.name, ramp) for kind in self.vehicle_types for ramp in (False, True)]
        return any(self.automated_share_of(*kind) < 1.0 for kind in kinds)

    @property
    def has_faults(self) -> bool:
        """Whether the world of this scenario is not perfect."""
        return not all(getattr(self, table).is_perfect for table in TABLES)

    @property
    def has_one_lane(self) -> bool:
        """Whether its road is coramp's own of one mainline lane, for which all strategies plan."""
        return self.network is None and self.mainline.lanes == 1

    @property
    def has_automated(self) -> bool:
        """Whether some vehicle of this scenario may be automated."""
        kinds = [(kind.name, ramp) for kind in self.vehicle_types for ramp in (False, True)]
        return any(self.automated_share_of(*kind) > 0.0 for kind in kinds)

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
                lanes=self.mainline.lanes,
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
        if given is None and self.network is not None:
            return 0.5 * self.ramp.start_m  # nobody is planned there
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
        """Station of the stop line of ramp metering, nearer to the nose where the ramp is short."""
        given = self.ramp.signal_station_m
        if given is not None:
            return given
        return max(SIGNAL_STATION_M, 0.25 * self.ramp.start_m, self.first_signal_m)

    @property
    def first_signal_m(self) -> float:
        """The first station on the ramp at which who has entered can stop in comfort."""
        speed_mps = self.ramp.limit_mps
        if self.network is not None:
            speed_mps = max(self.ramp.entry_speed_mps)
        braking_m = 0.5 * speed_mps**2 / self.motion.comfort_mps2
        return self.ramp.start_m + speed_mps * REACTION_S + braking_m

    @property
    def signal_problem(self) -> str:
        """What keeps the ramp from being metered: who enters must be able to stop at the line."""
        first_m, start_m = self.first_signal_m, self.ramp.start_m
        if first_m > LAST_SIGNAL_M:
            return (
                f"ramp.start_m: the ramp is {-start_m:g} m long, and who enters it takes "
                f"{first_m - start_m:.1f} m to stop at a signal; allowed is a ramp of "
                f"{first_m - start_m - LAST_SIGNAL_M:.1f} m or more"
            )
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
