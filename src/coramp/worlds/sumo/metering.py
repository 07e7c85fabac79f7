"""A signal at the ramp and loops on the road, for strategies that meter ordinary drivers."""

import math
from collections.abc import Iterable, Sequence

from coramp.messages.commands import SetSignal, WorldCommand
from coramp.messages.events import DetectorReading
from coramp.worlds.sumo.metered_road import MeterPlaces
from coramp.worlds.sumo.session import GREEN, RED, YELLOW, Session

YELLOW_S = 2.0
"""Between green and red; who cannot stop in comfort goes on. A fast or heavy one is not past the
line by then: yellow lasts until it is, as SUMO stops dead whom red leaves no way to stop."""
GOES_ON = 1.25
"""Who would have to brake harder than so many times its comfortable braking has decided to go on:
one that stops at the line brakes with 1, up to the rounding of steps."""


def loops(places: Sequence[MeterPlaces], period_s: float, given: str | None = None) -> str:
    """Returns SUMO's file of loops of meters; ``given`` is what else SUMO is told beside them."""
    lines = [
        f'  <inductionLoop id="{name}" lane="{lane}" pos="{place_m!r}" period="{period_s!r}" '
        'file="NUL"/>'
        for own in places
        for name, lane, place_m in own.loops
    ]
    rest = (given or "<additional>\n</additional>").replace("</additional>", "").strip()
    return "\n".join([rest, *lines, "</additional>", ""])


class Meter:
    """Reads the loops once a period, and sets the signal as it is commanded.

    ``readings`` and ``signals`` are what the loops told and what was commanded. The occupancy of
    the mainline is the mean over its lanes.
    """

    def __init__(self, session: Session, step_s: float, places: MeterPlaces) -> None:
        self._session = session
        self._step_s = step_s
        self._places = places
        self._red_s = math.inf
        self._on_ramp: set[str] = set()
        self._mainline = self._queue = 0.0
        self._samples = 0
        self.readings: list[DetectorReading] = []
        self.signals: list[SetSignal] = []
        session.set_signal(places.signal, places.stop_lane, GREEN)

    def read(self, first_step: int, last_step: int) -> DetectorReading:
        """Drives up to ``last_step`` and returns what the loops tell of the time till then."""
        for step in range(first_step + 1, last_step + 1):
            self._session.step_to(step)
            self.sample()
        self.readings.append(self.told(last_step * self._step_s)[0])
        return self.readings[-1]

    def sample(self) -> None:
        """Takes in what the loops saw in the last step."""
        seen = [self._session.loop_occupancy(loop.name) for loop in self._places.mainline]
        self._mainline += sum(seen) / len(seen)
        self._queue += self._session.loop_occupancy(self._places.queue.name)
        self._samples += 1

    def told(self, time_s: float) -> tuple[DetectorReading, int, int]:
        """Returns the reading since the last one, how many came onto the ramp, how many wait."""
        waiting = {v for lane in self._places.before for v in self._session.vehicles_on(lane)}
        passed, came = len(self._on_ramp - waiting), len(waiting - self._on_ramp)
        mainline, queue = self._mainline / self._samples, self._queue / self._samples
        self._on_ramp, self._samples = waiting, 0
        self._mainline = self._queue = 0.0
        return DetectorReading(time_s, mainline, queue, passed), came, len(waiting)

    def obey(self, commands: Iterable[WorldCommand], step: int) -> None:
        """Sets the signal as commanded; after ``YELLOW_S`` it is red, if all can stop by then."""
        time_s = step * self._step_s
        for signal in commands:
            if isinstance(signal, SetSignal):
                self.signals.append(signal)
                self.show(signal.green, time_s)
        self.go_on(time_s)

    def show(self, green: bool, time_s: float) -> None:
        """Sets the signal green, or yellow before it is red."""
        places = self._places
        self._session.set_signal(places.signal, places.stop_lane, GREEN if green else YELLOW)
        self._red_s = math.inf if green else time_s + YELLOW_S

    def go_on(self, time_s: float) -> None:
        """Sets red where yellow is over and all can stop."""
        stop_lane = self._places.stop_lane
        if time_s >= self._red_s and self._session.stopping_effort(stop_lane) <= GOES_ON:
            self._session.set_signal(self._places.signal, stop_lane, RED)
            self._red_s = math.inf
