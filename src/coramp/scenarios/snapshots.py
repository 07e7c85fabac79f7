"""Snapshots: vehicles as they stand at one moment, for a single decision."""

from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from coramp.equations.safe_distance import safe_distance_m
from coramp.errors import CorampError
from coramp.road.streams import STREAMS
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.model import Scenario
from coramp.scenarios.quantities import Length, Speed
from coramp.scenarios.sections import Model
from coramp.scenarios.toml_files import beside, read, validated


class SnapshotVehicle(Model):
    """One vehicle; its station is that of its front bumper, negative before the nose."""

    id: Annotated[str, Field(min_length=1)]
    stream: Literal["mainline", "ramp"]
    station_m: float
    speed_mps: Speed
    length_m: Length | None = None


class Snapshot(Model):
    """A situation on the road of a scenario; ``set`` overrides dotted keys of that."""

    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    scenario: str
    set: dict[str, Any] = Field(default={})
    vehicles: Annotated[tuple[SnapshotVehicle, ...], Field(strict=False, min_length=1)]

    @model_validator(mode="after")
    def _works_together(self) -> Self:
        try:
            scenario = self.road()
        except CorampError as error:
            raise ValueError("\n".join(f"scenario: {line}" for line in error.messages)) from None
        problems = [*_identity_problems(self), *_place_problems(self, scenario)]
        problems += _distance_problems(self, scenario)
        if problems:
            raise ValueError("\n".join(problems))
        return self

    def road(self) -> Scenario:
        """Returns the scenario, with what the snapshot sets."""
        return load_scenario(self.scenario, self.set, dict.fromkeys(self.set, "set"))

    def length_m(self, vehicle: SnapshotVehicle) -> float:
        """Returns a vehicle's own length, or the scenario's."""
        return vehicle.length_m or self.road().usual_length_m


def load_snapshot(name: str) -> Snapshot:
    """Returns the built-in snapshot of that name, or that of a file."""
    label, data = read("snapshots", name)
    if isinstance(data.get("scenario"), str):
        data["scenario"] = beside(name, data["scenario"])
    return validated(Snapshot, data, label)


def _identity_problems(snapshot: Snapshot) -> list[str]:
    problems, seen = [], set()
    for number, vehicle in enumerate(snapshot.vehicles):
        if vehicle.id in seen:
            problems.append(
                f"vehicles.{number}.id: {vehicle.id!r} is taken; every vehicle needs its own"
            )
        seen.add(vehicle.id)
    if not any(vehicle.stream == "ramp" for vehicle in snapshot.vehicles):
        problems.append("vehicles: none is on the ramp; at least one ramp vehicle is needed")
    return problems


def _place_problems(snapshot: Snapshot, scenario: Scenario) -> list[str]:
    problems = []
    for number, vehicle in enumerate(snapshot.vehicles):
        key = f"vehicles.{number}"
        if vehicle.stream == "mainline":
            first_m, last_m = scenario.mainline.start_m, scenario.mainline.end_m
            limit_mps = scenario.mainline.limit_mps
        else:
            braking_m = 0.5 * vehicle.speed_mps**2 / scenario.stop_mps2
            reaction_m = vehicle.speed_mps * scenario.control.actuation_delay_s
            first_m = scenario.ramp.start_m
            last_m = scenario.stop_station_m - braking_m - reaction_m
            limit_mps = scenario.ramp.limit_mps
        if not first_m <= vehicle.station_m <= last_m:
            why = ", where it can still stop before the nose" if vehicle.stream == "ramp" else ""
            problems.append(
                f"{key}.station_m: {vehicle.station_m:g} is outside the {vehicle.stream}; "
                f"allowed is {first_m:g} to {last_m:g} m{why}"
            )
        if vehicle.speed_mps > limit_mps:
            problems.append(
                f"{key}.speed_mps: {vehicle.speed_mps:g} is above {vehicle.stream}.limit_mps; "
                f"allowed is up to {limit_mps:g} m/s"
            )
    return problems


def _distance_problems(snapshot: Snapshot, scenario: Scenario) -> list[str]:
    safety, problems = scenario.rules().safety, []
    for stream in STREAMS:
        lane = [vehicle for vehicle in snapshot.vehicles if vehicle.stream == stream]
        lane.sort(key=lambda vehicle: -vehicle.station_m)
        for front, rear in pairwise(lane):
            length_m = front.length_m or scenario.usual_length_m
            gap_m = front.station_m - length_m - rear.station_m
            needed_m = safe_distance_m(front.speed_mps, rear.speed_mps, safety)
            if gap_m < 0.0:
                problems.append(
                    f"vehicles: {rear.id} overlaps {front.id} by {-gap_m:g} m; "
                    f"allowed is a distance of {needed_m:.3f} m or more"
                )
            elif gap_m < needed_m + safety.execution_allowance_m:
                problems.append(
                    f"vehicles: {rear.id} is {gap_m:g} m behind {front.id}, nearer than planning "
                    f"allows; allowed is {needed_m + safety.execution_allowance_m:.3f} m or more"
                )
    return problems
