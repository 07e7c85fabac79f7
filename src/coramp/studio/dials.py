"""What can be set in the studio, its ranges, and the run that a setting asks for."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from coramp.equations.gaps import least_acceleration_mps2
from coramp.errors import CorampError
from coramp.records.schemas import Row
from coramp.road.streams import STREAMS
from coramp.runs.running import RunSpec, make_spec
from coramp.scenarios.checks import decision_station_range_m
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.model import Scenario
from coramp.strategies.registry import strategies

NOTHING = "nothing"
HORIZON_S = 300.0
"""How long vehicles arrive at first; short enough to follow a slider."""


@dataclass(frozen=True)
class Dial:
    """A number to set: its name in the address, the scenario's key, and its range in ``unit``."""

    name: str
    key: str
    label: str
    unit: str
    low: float
    high: float
    step: float

    def value_of(self, scenario: Scenario) -> float:
        """Returns the scenario's own value."""
        value: Any = scenario
        for part in self.key.split("."):
            value = getattr(value, part)
        return float(value)

    def widened(self, value: float) -> "Dial":
        """Returns the dial with a range that holds the value."""
        low, high = min(self.low, value), max(self.high, value)
        return Dial(self.name, self.key, self.label, self.unit, low, high, self.step)

    def parsed(self, text: str) -> float:
        """Returns the number of a text; raises CorampError if it is none or out of range."""
        allowed = f"allowed is {self.low:g} to {self.high:g} {self.unit}"
        try:
            value = float(text)
        except ValueError:
            raise CorampError(f"{self.label}: {text!r} is not a number; {allowed}") from None
        if not math.isfinite(value) or not self.low <= value <= self.high:
            raise CorampError(f"{self.label}: {value:g} is out of range; {allowed}")
        return value


DIALS = (
    Dial("gap", "safety.time_gap_s", "time gap", "s", 0.0, 2.0, 0.1),
    Dial("mainline", "mainline.flow_veh_h", "mainline flow", "veh/h", 0.0, 4000.0, 50.0),
    Dial("ramp", "ramp.flow_veh_h", "ramp flow", "veh/h", 0.0, 1800.0, 25.0),
    Dial("lane", "ramp.acceleration_lane_m", "acceleration lane", "m", 50.0, 390.0, 5.0),
    Dial("mainline_speed", "mainline.speed_mps", "mainline speed", "m/s", 12.0, 36.0, 0.5),
    Dial("ramp_speed", "ramp.speed_mps", "ramp speed", "m/s", 8.0, 34.0, 0.5),
    Dial("standstill", "safety.standstill_gap_m", "standstill gap", "m", 0.0, 5.0, 0.1),
    Dial("error", "safety.positioning_error_m", "positioning error", "m", 0.0, 3.0, 0.02),
    Dial("horizon", "simulation.horizon_s", "time of arrivals", "s", 30.0, 1800.0, 30.0),
    Dial("seed", "", "seed", "", 0.0, 10_000.0, 1.0),
)
DECIDING = ("gap", "mainline", "ramp", "lane")
"""The dials that decide most; the page shows these at once and folds the others."""
CHOICES = ("strategy", "second")
USUAL_DRIVERS = "fair"


@dataclass(frozen=True)
class Studio:
    """The scenario that a studio starts from, by name or file."""

    source: str
    scenario: Scenario

    @property
    def dials(self) -> tuple[Dial, ...]:
        """The dials, each with a range that holds the value it starts at."""
        start = self.start
        return tuple(dial.widened(start[dial.name]) for dial in DIALS)

    @property
    def start(self) -> dict[str, float]:
        """Where each dial starts."""
        own = {dial.name: dial.value_of(self.scenario) for dial in DIALS if dial.key}
        return {**own, "horizon": min(HORIZON_S, own["horizon"]), "seed": 1.0}

    @property
    def choices(self) -> list[str]:
        """What may be chosen: cooperative strategies, then others with each kind of drivers."""
        every = strategies().items()
        return [
            *(name for name, found in every if found.cooperative),
            *(
                f"{name}:{drivers}"
                for name, found in every
                if not found.cooperative
                for drivers in self.scenario.drivers
            ),
        ]

    @property
    def chosen(self) -> dict[str, str]:
        """What is chosen at first: a cooperative strategy, and drivers beside it."""
        usual = f"uncontrolled:{USUAL_DRIVERS}"
        drivers = [name for name in self.choices if name.startswith("uncontrolled:")]
        second = usual if usual in drivers else next(iter(drivers), NOTHING)
        return {"strategy": self.choices[0], "second": second}

    def specs(self, asked: Mapping[str, str]) -> list[RunSpec]:
        """Returns the runs that an address asks for, one or two, on the same arrivals.

        Raises CorampError with a message for each thing that is wrong.
        """
        values = self._values(asked)
        names = [asked.get(choice, self.chosen[choice]) for choice in CHOICES]
        wanted = [name for name in dict.fromkeys(names) if name != NOTHING]
        if not wanted:
            raise CorampError("strategy: nothing is chosen; choose one")
        for name in wanted:
            if name not in self.choices:
                raise CorampError(
                    f"strategy: there is no {name!r}; allowed are {', '.join(self.choices)}"
                )
        overrides = self._overrides(values)
        return [_spec(self.source, name, overrides, int(values["seed"])) for name in wanted]

    def _values(self, asked: Mapping[str, str]) -> dict[str, float]:
        known = {dial.name: dial for dial in self.dials}
        if strange := [name for name in asked if name not in known and name not in CHOICES]:
            raise CorampError(
                f"{strange[0]}: cannot be set here; allowed are {', '.join([*known, *CHOICES])}"
            )
        values = dict(self.start)
        problems: list[str] = []
        for name in known.keys() & asked.keys():
            try:
                values[name] = known[name].parsed(asked[name])
            except CorampError as error:
                problems += error.messages
        if problems:
            raise CorampError(*sorted(problems))
        if values["seed"] != int(values["seed"]):
            raise CorampError(f"seed: {values['seed']:g} is not whole; allowed is a whole number")
        return values

    def _overrides(self, values: Mapping[str, float]) -> Row:
        changed = {
            dial.key: values[dial.name]
            for dial in DIALS
            if dial.key and values[dial.name] != dial.value_of(self.scenario)
        }
        return {**changed, **dict(_following(self.scenario, changed))}


def _following(scenario: Scenario, changed: Mapping[str, float]) -> Iterator[tuple[str, Any]]:
    """What must follow a change, so that a slider does not run into the scenario's own checks.

    Entry speeds and limits keep their ratio to the speed of their stream. The decision station and
    the ordinary acceleration move no further than the changed road asks (Eq. 22).
    """
    for stream in STREAMS:
        speed_mps = changed.get(f"{stream}.speed_mps")
        if speed_mps is None:
            continue
        own = getattr(scenario, stream)
        ratio = speed_mps / own.speed_mps
        yield f"{stream}.limit_mps", round(own.limit_mps * ratio, 6)
        low, high = own.entry_speed_mps
        yield f"{stream}.entry_speed_mps", [round(low * ratio, 6), round(high * ratio, 6)]
    road = {"mainline.speed_mps", "ramp.speed_mps", "ramp.acceleration_lane_m"}
    if road & changed.keys():
        yield from _planning(scenario, changed)


def _planning(scenario: Scenario, changed: Mapping[str, float]) -> Iterator[tuple[str, Any]]:
    v0 = changed.get("mainline.speed_mps", scenario.mainline.speed_mps)
    ramp_mps = changed.get("ramp.speed_mps", scenario.ramp.speed_mps)
    lane_m = changed.get("ramp.acceleration_lane_m", scenario.ramp.acceleration_lane_m)
    if ramp_mps >= v0:
        return
    ratio = ramp_mps / scenario.ramp.speed_mps
    mainline = scenario.mainline.model_copy(update={"speed_mps": v0})
    ramp = scenario.ramp.model_copy(
        update={
            "speed_mps": ramp_mps,
            "limit_mps": scenario.ramp.limit_mps * ratio,
            "acceleration_lane_m": lane_m,
        }
    )
    road = scenario.model_copy(update={"mainline": mainline, "ramp": ramp})
    if road.last_merge_station_m <= 0.0:
        return
    first_m, last_m = decision_station_range_m(road)
    own_m = scenario.ramp.decision_station_m
    if own_m is not None and first_m <= last_m and not first_m <= own_m <= last_m:
        inside = (
            math.ceil(10.0 * first_m) / 10.0 if own_m < first_m else math.floor(10 * last_m) / 10
        )
        yield "ramp.decision_station_m", inside
    least = least_acceleration_mps2(v0, ramp_mps, road.last_merge_station_m)
    own_mps2 = scenario.motion.free_acceleration_mps2
    if own_mps2 < least <= scenario.motion.ramp_acceleration_mps2:
        yield "motion.free_acceleration_mps2", math.ceil(1000.0 * least) / 1000.0


def _spec(source: str, name: str, overrides: Row, seed: int) -> RunSpec:
    strategy, _, drivers = name.partition(":")
    return make_spec(
        source,
        strategy,
        engine="sumo" if drivers else "exact",
        drivers=drivers or None,
        overrides=overrides,
        seed=seed,
        blamed="studio",
    )


def studio_of(source: str) -> Studio:
    """Returns the studio of a scenario, by name or file; raises CorampError if it is not valid."""
    scenario = load_scenario(source)
    if scenario.arrivals:
        raise CorampError(
            f"{source}: lists its arrivals one by one, which no slider can change; "
            "allowed is a scenario with flows"
        )
    return Studio(source, scenario)
