"""The meters of a corridor: a signal and loops at each ramp, and one strategy that sets them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from coramp.records.corridor_outcome import METERS
from coramp.scenarios.corridors import Corridor, on_network
from coramp.strategies.base import Detectors, steps_of_period
from coramp.strategies.metering import MetersRamps, RampSeen, Update
from coramp.worlds.sumo.corridor_road import corridor_road
from coramp.worlds.sumo.metered_road import MeterPlaces, places_of, room_veh, stop_line
from coramp.worlds.sumo.metering import Meter, loops
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.signalled import StopLine, signalled_network


class MeteredCorridor(NamedTuple):
    """A corridor whose network has a signal on each ramp, with where its meters are."""

    corridor: Corridor
    places: tuple[MeterPlaces, ...]
    rooms_veh: tuple[float, ...]

    def loops(self, period_s: float, given: str | None) -> str:
        """Returns SUMO's file of all loops; ``given`` is what else SUMO is told."""
        return loops(self.places, period_s, given)

    @property
    def roads(self) -> list[list[int]]:
        """The places of each road's sites, in driving order."""
        found: list[list[int]] = []
        for road in self.corridor.roads:
            first = sum(len(own) for own in found)
            found.append(list(range(first, first + len(road.sites))))
        return found


def metered_corridor(corridor: Corridor) -> MeteredCorridor:
    """Returns a corridor with a signal on each ramp; its sites, zones and lengths stay."""
    lines: list[StopLine] = [
        stop_line(site, scenario.signal_station_m)
        for site, scenario in zip(corridor.sites, corridor.scenarios, strict=True)
    ]
    file = signalled_network(corridor.file, corridor.section.sha256, tuple(lines))
    found = on_network(corridor, file)
    roads = [own.road for own in corridor_road(found).sites]
    places = tuple(
        places_of(scenario, road, site, line, f"-{k}")
        for k, (scenario, road, site, line) in enumerate(
            zip(corridor.scenarios, roads, found.sites, lines, strict=True)
        )
    )
    return MeteredCorridor(found, places, tuple(map(room_veh, corridor.scenarios)))


@dataclass
class CorridorMeters:
    """Drives a session on, reads all loops at each step, and sets the signals once a period.

    ``updates`` are the times (s) and the updates of the meters' rates.
    """

    session: Session
    step_s: float
    metered: MeteredCorridor
    strategy: MetersRamps
    updates: list[tuple[float, Update]] = field(default_factory=list)
    _memory: Any = None
    _step: int = 0

    def __post_init__(self) -> None:
        """All signals are green, and the first period begins."""
        self._meters = [Meter(self.session, self.step_s, own) for own in self.metered.places]
        self._green = [True] * len(self._meters)
        self._period_steps = steps_of_period(self.strategy.period_s, self.step_s)

    def step_to(self, step: int) -> None:
        """Executes all steps before ``step``."""
        for now in range(self._step + 1, step + 1):
            self.session.step_to(now)
            for meter in self._meters:
                meter.sample()
            if now % self._period_steps == 0:
                self._decide(now * self.step_s)
        self._step = step

    def _decide(self, now_s: float) -> None:
        seen = [
            _seen(meter, now_s, room)
            for meter, room in zip(self._meters, self.metered.rooms_veh, strict=True)
        ]
        answer = self.strategy.meter(now_s, seen, self.metered.roads, self._memory)
        self._memory = answer.memory
        self.updates += [(now_s, update) for update in answer.updates]
        for k, (meter, green) in enumerate(zip(self._meters, answer.green, strict=True)):
            if green != self._green[k]:
                meter.show(green, now_s)
            meter.go_on(now_s)
            self._green[k] = green


def _seen(meter: Meter, now_s: float, room: float) -> RampSeen:
    told, came, waiting = meter.told(now_s)
    detectors = Detectors(told.mainline_occupancy, told.queue_occupancy, told.passed_veh)
    return RampSeen(detectors, came, waiting, room)


def metering_on(
    session: Session, step_s: float, metered: MeteredCorridor | None, strategy: MetersRamps | None
) -> CorridorMeters | None:
    """Returns the meters of a session, None where nothing is metered."""
    if metered is None or strategy is None:
        return None
    return CorridorMeters(session, step_s, metered, strategy)


def rows_of(updates: Sequence[tuple[float, Update]], corridor: Corridor) -> dict[str, list[Any]]:
    """Returns the updates as columns; sites by their ids."""
    names = [site.ramp_id for site in corridor.sites]
    rows = [
        {
            "time_s": time_s,
            "site": names[own.ramp],
            "occupancy_percent": own.occupancy_percent,
            "queue_occupancy_percent": own.queue_percent,
            "arrivals_veh_h": own.arrivals_veh_h,
            "queue_veh": own.queue_veh,
            "room_veh": own.room_veh,
            "rate_veh_h": own.rate_veh_h,
            "let_go": own.let_go,
            "role": own.role,
            "master": names[own.master],
        }
        for time_s, own in updates
    ]
    return {key: [row[key] for row in rows] for key in METERS}
