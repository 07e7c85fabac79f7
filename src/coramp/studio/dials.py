"""What can be set in the studio, its ranges, and the run that a setting asks for."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from coramp.errors import CorampError
from coramp.records.schemas import Row
from coramp.runs.mixed import check_mixed, coordinates_drivers, is_plannable
from coramp.runs.running import UNCONTROLLED, RunSpec, make_spec
from coramp.scenarios.corridors import is_corridor
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Strategy, makes_way
from coramp.strategies.registry import strategies
from coramp.studio.following import following
from coramp.studio.world import PERFECT, PRESET_WORDS, share_percent, with_share

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
    Dial("share", "", "automated vehicles", "%", 0.0, 100.0, 5.0),
    Dial("mainline_speed", "mainline.speed_mps", "mainline speed", "m/s", 12.0, 36.0, 0.5),
    Dial("ramp_speed", "ramp.speed_mps", "ramp speed", "m/s", 8.0, 34.0, 0.5),
    Dial("standstill", "safety.standstill_gap_m", "standstill gap", "m", 0.0, 5.0, 0.1),
    Dial("error", "safety.positioning_error_m", "positioning error", "m", 0.0, 3.0, 0.02),
    Dial("horizon", "simulation.horizon_s", "time of arrivals", "s", 30.0, 1800.0, 30.0),
    Dial("seed", "", "seed", "", 0.0, 10_000.0, 1.0),
)
OF_NETWORK = ("ramp.acceleration_lane_m", "mainline.speed_mps", "ramp.speed_mps")
OF_DEMAND = ("mainline.flow_veh_h", "ramp.flow_veh_h")
"""What is as it is in a network, and where counts or demand over time are given."""
DECIDING = ("gap", "mainline", "ramp", "lane", "share")
"""The dials that decide most; the page shows these at once and folds the others."""
CHOICES = ("strategy", "second")
WORLDS = ("preset", "drivers")
"""What of the world is chosen from a list."""
AMONG_DRIVERS = "mixed-slots"
AUTOMATION = "automation"
"""The choice of automated vehicles that nobody coordinates; others name their strategy."""


@dataclass(frozen=True)
class Studio:
    """The scenario that a studio starts from, by name or file."""

    source: str
    scenario: Scenario

    @property
    def dials(self) -> tuple[Dial, ...]:
        """The dials of what can be set, each with a range that holds the value it starts at.

        Lengths and limits are those of a network; counts and demand over time say how many come.
        """
        start, scenario = self.start, self.scenario
        fixed = {*(OF_NETWORK if scenario.network else ()), *(OF_DEMAND if scenario.demand else ())}
        return tuple(dial.widened(start[dial.name]) for dial in DIALS if dial.key not in fixed)

    @property
    def start(self) -> dict[str, float]:
        """Where each dial starts."""
        own = {dial.name: dial.value_of(self.scenario) for dial in DIALS if dial.key}
        horizon_s = min(HORIZON_S, own["horizon"])
        return {**own, "horizon": horizon_s, "share": share_percent(self.scenario), "seed": 1.0}

    @property
    def choices(self) -> list[str]:
        """What may be chosen: cooperative strategies, then others with each kind of drivers.

        Those with a kind of drivers have nobody automated. Automation alone stands between.
        """
        every = [found for found in strategies().items() if _can_drive(self.scenario, found[1])]
        return [
            *(name for name, found in every if found.cooperative),
            AUTOMATION,
            *(
                f"{name}:{drivers}"
                for name, found in every
                if not found.cooperative
                for drivers in self.scenario.drivers
            ),
        ]

    @property
    def among_drivers(self) -> list[str]:
        """Those of the choices that can run among drivers, or where the world fails."""
        every = strategies()
        return [n for n in self.choices if n not in every or coordinates_drivers(every[n])]

    @property
    def chosen(self) -> dict[str, str]:
        """What is chosen at first: a cooperative strategy, drivers beside it, and the world."""
        known = list(self.scenario.drivers)
        usual = self.scenario.traffic.drivers
        drivers = usual if usual in known else next(iter(known), usual)
        return {
            "strategy": AMONG_DRIVERS if _is_mixed(self.scenario) else self.choices[0],
            "second": f"{UNCONTROLLED}:{drivers}" if known else NOTHING,
            "preset": self.scenario.world.preset or PERFECT,
            "drivers": drivers,
        }

    def specs(self, asked: Mapping[str, str]) -> list[RunSpec]:
        """Returns the runs that an address asks for, one or two, on the same arrivals.

        Without a strategy in the address it is the first, among drivers the one that can run there.
        Raises CorampError with a message for each thing that is wrong.
        """
        values = self._values(asked)
        self._check_world(asked)
        chosen = {**self.chosen, **{name: asked[name] for name in WORLDS if name in asked}}
        if "drivers" in asked:
            chosen["second"] = f"{UNCONTROLLED}:{chosen['drivers']}"
        overrides = self._overrides(values, chosen["preset"])
        world = load_scenario(self.source, overrides, dict.fromkeys(overrides, "studio"))
        if _is_mixed(world):
            chosen["strategy"] = AMONG_DRIVERS
        chosen |= {name: asked[name] for name in CHOICES if name in asked}
        wanted = [chosen[name] for name in CHOICES if chosen[name] != NOTHING]
        if not wanted:
            raise CorampError("strategy: nothing is chosen; choose one")
        for name in wanted:
            if name not in self.choices:
                raise CorampError(
                    f"strategy: there is no {name!r}; allowed are {', '.join(self.choices)}"
                )
        if not world.has_automated:
            alone = f"{UNCONTROLLED}:{chosen['drivers']}"
            wanted = [alone if name in {AMONG_DRIVERS, AUTOMATION} else name for name in wanted]
        return [
            self._spec(name, world, overrides, chosen["drivers"], int(values["seed"]))
            for name in dict.fromkeys(wanted)
        ]

    def _spec(self, name: str, world: Scenario, overrides: Row, drivers: str, seed: int) -> RunSpec:
        """The run of a choice in a world that the overrides make of the scenario."""
        strategy, _, own_drivers = name.partition(":")
        shares: Row = {}
        if own_drivers and world.gives_shares:
            shares = with_share(world, 0.0)
        elif name == AUTOMATION and not world.gives_shares:
            shares = with_share(world, 100.0)
        in_sumo = bool(own_drivers) or name == AUTOMATION or _is_mixed(world)
        return make_spec(
            self.source,
            UNCONTROLLED if name == AUTOMATION else strategy,
            engine="sumo" if in_sumo else "exact",
            drivers=(own_drivers or drivers) if in_sumo else None,
            overrides={**overrides, **shares},
            seed=seed,
            blamed="studio",
        )

    def _check_world(self, asked: Mapping[str, str]) -> None:
        allowed = {"preset": list(PRESET_WORDS), "drivers": list(self.scenario.drivers)}
        for name, known in allowed.items():
            if name in asked and asked[name] not in known:
                raise CorampError(
                    f"{name}: there is no {asked[name]!r}; allowed are {', '.join(known)}"
                )

    def _values(self, asked: Mapping[str, str]) -> dict[str, float]:
        known = {dial.name: dial for dial in self.dials}
        every = (*known, *CHOICES, *WORLDS)
        if strange := [name for name in asked if name not in every]:
            raise CorampError(f"{strange[0]}: cannot be set here; allowed are {', '.join(every)}")
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

    def _overrides(self, values: Mapping[str, float], preset: str) -> Row:
        world: Row = {}
        if preset != self.chosen["preset"]:
            world["world.preset"] = None if preset == PERFECT else preset
        if values["share"] != self.start["share"]:
            world |= with_share(self.scenario, values["share"])
        changed = {
            dial.key: values[dial.name]
            for dial in self.dials
            if dial.key and values[dial.name] != dial.value_of(self.scenario)
        }
        return {**changed, **dict(following(self.scenario, changed)), **world}


def _is_mixed(scenario: Scenario) -> bool:
    """Whether only SUMO has this world: drivers, several lanes, or where something goes wrong."""
    return scenario.is_mixed or scenario.has_faults or not scenario.has_one_lane


def _can_drive(scenario: Scenario, strategy: type[Strategy]) -> bool:
    """Whether a strategy knows the road of a scenario: several lanes or a network, not all do."""
    if scenario.has_one_lane or (makes_way(strategy) and is_plannable(scenario)):
        return True
    try:
        check_mixed(scenario, strategy, "sumo", scenario.traffic.drivers)
    except CorampError:
        return False
    return True


def studio_of(source: str) -> Studio:
    """Returns the studio of a scenario, by name or file; raises CorampError if it is not valid."""
    if is_corridor(source):
        raise CorampError(
            f"{source}: has several merge sites, which the studio does not show; "
            "allowed is a scenario of one"
        )
    scenario = load_scenario(source)
    if scenario.arrivals:
        raise CorampError(
            f"{source}: lists its arrivals one by one, which no slider can change; "
            "allowed is a scenario with flows"
        )
    return Studio(source, scenario)
