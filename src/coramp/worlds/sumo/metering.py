"""A signal at the ramp and loops on the road, for strategies that meter ordinary drivers."""

import math
from collections.abc import Iterable

from coramp.messages.commands import SetSignal, WorldCommand
from coramp.messages.events import DetectorReading
from coramp.scenarios.model import Scenario
from coramp.worlds.sumo.session import GREEN, RED, YELLOW, Session

MAINLINE_LOOP, QUEUE_LOOP = "mainline", "queue"
QUEUE_LOOP_M, QUEUE_LOOP_SHARE = 100.0, 0.3
"""How far behind its start, or at which share of the way to the stop line, the ramp has the loop
that sees a queue too long for it: SUMO lets nobody in who could not stop behind the queue, so that
at 16 m/s the last one stands some 80 m from the start and the others wait outside."""
SIGNAL, RAMP_LANE = "stopline", "ramp_0"
YELLOW_S = 2.0
"""Between green and red; who cannot stop in comfort goes on. A fast or heavy one is not past the
line by then: yellow lasts until it is, as SUMO stops dead whom red leaves no way to stop."""
GOES_ON = 1.25
"""Who would have to brake harder than so many times its comfortable braking has decided to go on:
one that stops at the line brakes with 1, up to the rounding of steps."""


def loops(scenario: Scenario, period_s: float) -> str:
    """Returns SUMO's file of loops: beside the acceleration lane and at the ramp's start."""
    places = (
        (MAINLINE_LOOP, "merge_1", scenario.detector_station_m),
        (
            QUEUE_LOOP,
            RAMP_LANE,
            queue_loop_m(scenario),
        ),
    )
    lines = [
        f'  <inductionLoop id="{name}" lane="{lane}" pos="{place_m!r}" period="{period_s!r}" '
        'file="NUL"/>'
        for name, lane, place_m in places
    ]
    return "\n".join(["<additional>", *lines, "</additional>", ""])


def queue_loop_m(scenario: Scenario) -> float:
    """Returns where (m from its start) the ramp has its loop for the queue."""
    to_stop_line_m = scenario.signal_station_m - scenario.ramp.start_m
    return min(QUEUE_LOOP_M, QUEUE_LOOP_SHARE * to_stop_line_m)


class Meter:
    """Reads the loops once a period, and sets the signal as it is commanded.

    ``readings`` and ``signals`` are what the loops told and what was commanded.
    """

    def __init__(self, session: Session, step_s: float) -> None:
        self._session = session
        self._step_s = step_s
        self._red_s = math.inf
        self._on_ramp: set[str] = set()
        self.readings: list[DetectorReading] = []
        self.signals: list[SetSignal] = []
        session.set_signal(SIGNAL, RAMP_LANE, GREEN)

    def read(self, first_step: int, last_step: int) -> DetectorReading:
        """Drives up to ``last_step`` and returns what the loops tell of the time till then."""
        mainline = queue = 0.0
        for step in range(first_step + 1, last_step + 1):
            self._session.step_to(step)
            mainline += self._session.loop_occupancy(MAINLINE_LOOP)
            queue += self._session.loop_occupancy(QUEUE_LOOP)
        steps = last_step - first_step
        waiting = self._session.vehicles_on(RAMP_LANE)
        passed, self._on_ramp = len(self._on_ramp - waiting), waiting
        time_s = last_step * self._step_s
        self.readings.append(DetectorReading(time_s, mainline / steps, queue / steps, passed))
        return self.readings[-1]

    def obey(self, commands: Iterable[WorldCommand], step: int) -> None:
        """Sets the signal at ``step``: yellow first where it is to be red.

        Red waits for whom it would catch too near to the line to stop.
        """
        time_s = step * self._step_s
        for signal in commands:
            if not isinstance(signal, SetSignal):
                continue
            self.signals.append(signal)
            self._session.set_signal(SIGNAL, RAMP_LANE, GREEN if signal.green else YELLOW)
            self._red_s = math.inf if signal.green else time_s + YELLOW_S
        if time_s >= self._red_s and self._session.stopping_effort(RAMP_LANE) <= GOES_ON:
            self._session.set_signal(SIGNAL, RAMP_LANE, RED)
            self._red_s = math.inf
