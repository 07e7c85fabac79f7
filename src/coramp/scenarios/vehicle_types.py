"""Types of vehicles: what a scenario may say of each, and the two that are built in."""

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from coramp.kinematics.fuel import FUEL_MODELS, HEAVY_DUTY, PASSENGER_CAR, FuelModel
from coramp.road.streams import STREAMS
from coramp.scenarios.quantities import Length, Speed
from coramp.vehicles.traits import CAR, CAR_MASS_KG, Traits

TRUCK = "truck"
SHARES_SUM_TO = 1e-6
"""By so much may shares differ from 1 in sum."""

Share = Annotated[float, Field(ge=0.0, le=1.0)]
SumoClass = Literal["passenger", "delivery", "truck", "trailer", "bus", "coach"]

BUILT_IN: dict[str, dict[str, Any]] = {
    CAR: {
        "length_m": 5.0,
        "mass_kg": CAR_MASS_KG,
        "fuel": FUEL_MODELS[PASSENGER_CAR],
        "sumo_class": "passenger",
    },
    TRUCK: {
        "length_m": 16.5,
        "mass_kg": 40000.0,
        "acceleration_mps2": 1.0,
        "power_wpkg": 5.5,
        "braking_mps2": 2.5,
        "top_speed_mps": (80.0 / 3.6, 90.0 / 3.6),
        "fuel": FUEL_MODELS[HEAVY_DUTY],
        "sumo_class": "trailer",
    },
}
"""What the built-in types have, by name; what a type leaves out is as a car's.

The truck is an articulated one. 16.5 m and 40 t: Directive 96/53/EC, Annex I. 80 to 90 km/h: the
limit for trucks on motorways in most of Europe, and the limiter of Directive 92/6/EEC. 1 m/s2 at
rest: about SUMO's vehicle class ``trailer``. 5.5 W/kg: 340 kW (8.5 W/kg) less 10 % in the drive
line, and less rolling (0.006 g v) and air resistance (0.5 rho c_w A v^3 / m with c_w A = 5.2 m2) at
80 km/h.
"""


class VehicleType(BaseModel):
    """One type of vehicles. What is left out is a car's, or what binds all vehicles.

    ``share`` is the type's share of both streams; ``mainline_share`` and ``ramp_share`` are its
    share of one. A vehicle with ``power_wpkg`` speeds up by at most that over its speed.
    ``top_speed_mps`` is the speed at which it cruises where v0 is higher, one for all or two
    between which each vehicle draws its own. ``fuel`` names a model of ``kinematics.fuel``,
    ``sumo_class`` SUMO's vClass for drivers.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    name: Annotated[str, Field(min_length=1, pattern=r"^[A-Za-z0-9_-]+$")]
    share: Share | None = None
    mainline_share: Share | None = None
    ramp_share: Share | None = None
    length_m: Length = BUILT_IN[CAR]["length_m"]
    mass_kg: Annotated[float, Field(ge=50.0, le=200000.0)] = BUILT_IN[CAR]["mass_kg"]
    acceleration_mps2: Annotated[float, Field(ge=0.1, le=10.0)] | None = None
    power_wpkg: Annotated[float, Field(ge=0.5, le=1000.0)] | None = None
    braking_mps2: Annotated[float, Field(ge=0.5, le=10.0)] | None = None
    top_speed_mps: Annotated[tuple[Speed, Speed], Field(strict=False)] | None = None
    time_gap_s: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    positioning_error_m: Annotated[float, Field(ge=0.0, le=20.0)] | None = None
    clock_error_s: Annotated[float, Field(ge=0.0, le=1.0)] | None = None
    fuel: FuelModel = BUILT_IN[CAR]["fuel"]
    sumo_class: SumoClass = BUILT_IN[CAR]["sumo_class"]

    @model_validator(mode="before")
    @classmethod
    def _as_built_in(cls, data: Any) -> Any:
        """Fills in what a built-in type has; a single top speed is one for all."""
        if not isinstance(data, dict):
            return data
        name = data.get("name")
        data = {**(BUILT_IN.get(name, {}) if isinstance(name, str) else {}), **data}
        top = data.get("top_speed_mps")
        if isinstance(top, int | float) and not isinstance(top, bool):
            data["top_speed_mps"] = (float(top), float(top))
        return data

    def share_of(self, on_ramp: bool) -> float:
        """Returns the type's share of a stream."""
        own = self.ramp_share if on_ramp else self.mainline_share
        return (self.share or 0.0) if own is None else own

    @property
    def top_speeds_mps(self) -> tuple[float, float]:
        """Between which speeds each vehicle draws its own; infinity where v0 alone binds."""
        return self.top_speed_mps or (math.inf, math.inf)

    @property
    def is_usual(self) -> bool:
        """Whether only the common limits bind vehicles of this type, whatever their length."""
        bound = (self.acceleration_mps2, self.power_wpkg, self.braking_mps2, self.top_speed_mps)
        errors = (self.time_gap_s, self.positioning_error_m, self.clock_error_s)
        return all(value is None for value in (*bound, *errors))

    def traits(self, usual: Traits, top_speed_mps: float) -> Traits:
        """Returns what one vehicle can do that cruises at ``top_speed_mps``; else as usual."""

        def own(value: float | None, otherwise: float) -> float:
            return otherwise if value is None else value

        return Traits(
            self.length_m,
            own(self.positioning_error_m, usual.positioning_error_m),
            own(self.clock_error_s, usual.clock_error_s),
            own(self.time_gap_s, usual.time_gap_s),
            top_speed_mps,
            own(self.acceleration_mps2, math.inf),
            own(self.power_wpkg, math.inf),
            own(self.braking_mps2, math.inf),
            self.mass_kg,
        )


def share_problems(types: tuple[VehicleType, ...]) -> list[str]:
    """Returns a line for each name that comes twice, and each stream whose shares are not 1."""
    names = [kind.name for kind in types]
    problems = [
        f"vehicle.{k}.name: {name!r} is given twice; allowed is once"
        for k, name in enumerate(names)
        if name in names[:k]
    ]
    for on_ramp, stream in enumerate(STREAMS):
        total = sum(kind.share_of(bool(on_ramp)) for kind in types)
        if abs(total - 1.0) > SHARES_SUM_TO:
            told = ", ".join(f"{kind.name} {kind.share_of(bool(on_ramp)):g}" for kind in types)
            problems.append(
                f"vehicle: shares of the {stream} sum to {total:g} ({told}); allowed is 1 "
                f"(keys share and {stream}_share)"
            )
    return problems
