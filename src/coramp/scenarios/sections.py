"""The tables of a scenario file, each as a model of its keys. All numbers are SI."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from coramp.equations.conflict_risk import GRAVITY_MPS2
from coramp.scenarios.quantities import Length, Speed
from coramp.scenarios.vehicle_types import BUILT_IN, VehicleType
from coramp.vehicles.traits import CAR

LONGEST_STEP_S = 0.25
"""Up to here SUMO was seen to stay within 5 cm of the plan; the error grows with the square."""


class Model(BaseModel):
    """Frozen, strict, and without room for keys that nobody reads."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


SpeedRange = Annotated[tuple[Speed, Speed], Field(strict=False)]
Flow = Annotated[float, Field(ge=0.0)]
Headway = Annotated[float, Field(gt=0.0, le=60.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
SharePart = Annotated[float, Field(ge=0.0, le=1.0)]


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
    """The mainline of the control zone; station 0 is the end of the ramp.

    Its flow is that of all ``lanes``. ``lane_shares`` are the shares of it that enter on each lane,
    from the outermost on, next to the ramp; left out, all are alike.
    """

    end_m: Annotated[float, Field(gt=0.0, le=20000.0)]
    lanes: Annotated[int, Field(ge=1, le=4)] = 1
    lane_shares: Annotated[tuple[SharePart, ...], Field(strict=False)] | None = None

    @property
    def shares(self) -> tuple[float, ...]:
        """The share of the flow that enters on each lane, from the outermost on."""
        return self.lane_shares or (1.0 / self.lanes,) * self.lanes


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

    length_m: Length = BUILT_IN[CAR]["length_m"]


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


class DriverPopulation(Model):
    """A population of ordinary drivers for uncontrolled runs, in SUMO's terms.

    ``wish`` is the speed that each seeks: its own entry speed everywhere, or v_R0 on the ramp and
    v0 from there on, times its ``speed_factor`` if there is one. ``tau_s`` is one time gap for
    all, or a list of equally likely ones. ``accel_mps2`` is SUMO's own if left out.
    ``car_following`` is SUMO's model; ``sigma`` counts for Krauss alone. ``origin`` says where the
    population comes from, if it was fitted to something.
    """

    wish: Literal["entry-speed", "free-flow"]
    speed_factor: SpeedFactor | None = None
    accel_mps2: Annotated[float, Field(gt=0.0, le=10.0)] | None = None
    sigma: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    tau_s: DriverGaps = 1.0
    min_gap_m: Annotated[float, Field(ge=0.0, le=20.0)] = 2.5
    lc_cooperative: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    lc_assertive: Annotated[float, Field(gt=0.0, le=20.0)] = 1.0
    lc_strategic: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    lc_speed_gain: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    car_following: Literal["Krauss", "IDM", "EIDM", "ACC", "CACC"] = "Krauss"
    integrator: Literal["euler", "ballistic"] = "euler"
    origin: str = ""

    @property
    def highest_factor(self) -> float:
        """The highest factor of the common speed that a driver may wish, 1 without factors."""
        return 1.0 if self.speed_factor is None else self.speed_factor.high

    @property
    def taus_s(self) -> tuple[float, ...]:
        """The time gaps that drivers keep, equally likely."""
        return self.tau_s if isinstance(self.tau_s, tuple) else (self.tau_s,)

    @property
    def mean_tau_s(self) -> float:
        """The time gap that drivers keep on average."""
        return sum(self.taus_s) / len(self.taus_s)


class TrafficMix(Model):
    """Which vehicles are automated and which have drivers, in SUMO.

    ``automated_share`` holds for both streams; ``mainline_automated_share`` and
    ``ramp_automated_share`` for one; a type of vehicles may have its own. ``drivers`` names the
    population of the others, of whom ``connected_share`` tell the coordinator where they are.
    ``automation`` is how automated vehicles drive that nobody coordinates: by SUMO's Krauss without
    imperfection, which yields to who wants to change lanes or does not, or by its ACC or CACC,
    which yield.
    """

    automated_share: SharePart | None = None
    mainline_automated_share: SharePart | None = None
    ramp_automated_share: SharePart | None = None
    drivers: Annotated[str, Field(min_length=1)] = "fair"
    connected_share: SharePart = 1.0
    automation: Literal["yielding", "not-yielding", "acc", "cacc"] = "yielding"

    @property
    def gives_shares(self) -> bool:
        """Whether it says of any stream which share is automated."""
        shares = (
            self.automated_share,
            self.mainline_automated_share,
            self.ramp_automated_share,
        )
        return any(share is not None for share in shares)

    def share_of(self, on_ramp: bool) -> float:
        """Returns the automated share of a stream, 1 where nothing is said."""
        own = self.ramp_automated_share if on_ramp else self.mainline_automated_share
        given = self.automated_share if own is None else own
        return 1.0 if given is None else given


class ExplicitArrival(Model):
    """One vehicle of a given list of arrivals; times lie on the step grid.

    Left out, ``type`` is the first type of the scenario, and ``top_speed_mps`` the mean of its own.
    ``lane`` is that of the mainline, 0 next to the ramp.
    """

    stream: Literal["mainline", "ramp"]
    time_s: NotNegative
    speed_mps: Speed
    length_m: Length | None = None
    type: str | None = None
    top_speed_mps: Speed | None = None
    lane: Annotated[int, Field(ge=0, le=3)] = 0


class Simulation(Model):
    """How long vehicles arrive, and how long a run may go on after that until it is empty."""

    horizon_s: Annotated[float, Field(gt=0.0, le=86400.0)] = 1800.0
    drain_s: Annotated[float, Field(gt=0.0, le=86400.0)] = 1800.0
