"""A signal at the ramp and loops on the road, for strategies that meter ordinary drivers."""

import math

import numpy as np

from coramp.coordination.ledger import Ledger
from coramp.messages.commands import SetSignal
from coramp.messages.events import DetectorReading
from coramp.road.rules import packed
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Decider, Detectors, Memory, Reports, SetRampSignal, View
from coramp.worlds.sumo.session import GREEN, RED, YELLOW, Session

MAINLINE_LOOP, QUEUE_LOOP = "mainline", "queue"
QUEUE_LOOP_M, QUEUE_LOOP_SHARE = 100.0, 0.3
"""How far behind its start, or at which share of the way to the stop line, the ramp has the loop
that sees a queue too long for it: SUMO lets nobody in who could not stop behind the queue, so that
at 16 m/s the last one stands some 80 m from the start and the others wait outside."""
SIGNAL, RAMP_LANE = "stopline", "ramp_0"
YELLOW_S = 2.0
"""Between green and red; who cannot stop in comfort by then goes on."""


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
    """Asks a strategy once a period, with what the loops tell, and sets the signal.

    ``readings`` and ``signals`` are what it was told and what it commanded.
    """

    def __init__(self, session: Session, scenario: Scenario, strategy: Decider) -> None:
        self._session = session
        self._strategy = strategy
        self._step_s = scenario.control.step_s
        self._memory: Memory = None
        rules = scenario.rules()
        self._rules, self._packed = rules, packed(rules)
        self._fastest_mps = scenario.fastest_mainline_entry_mps
        self._nobody = Ledger(rules.road.mainline_speed_mps, rules.road.mainline_end_m).fleet
        self._red_s = math.inf
        self._on_ramp: set[str] = set()
        self.readings: list[DetectorReading] = []
        self.signals: list[SetSignal] = []
        session.set_signal(SIGNAL, RAMP_LANE, GREEN)

    def run(self, first_step: int, last_step: int) -> None:
        """Drives up to ``last_step``, asks the strategy with what the loops told, and does it."""
        mainline = queue = 0.0
        for step in range(first_step + 1, last_step + 1):
            self._session.step_to(step)
            mainline += self._session.loop_occupancy(MAINLINE_LOOP)
            queue += self._session.loop_occupancy(QUEUE_LOOP)
        steps = last_step - first_step
        self._decide(last_step * self._step_s, mainline / steps, queue / steps)

    def _decide(self, time_s: float, mainline_occupancy: float, queue_occupancy: float) -> None:
        view = self._view(time_s, mainline_occupancy, queue_occupancy)
        decision = self._strategy.decide(view, self._memory)
        self._memory = decision.memory
        for command in decision.commands:
            if isinstance(command, SetRampSignal):
                self.signals.append(SetSignal(round(time_s / self._step_s), command.green))
                self._session.set_signal(SIGNAL, RAMP_LANE, GREEN if command.green else YELLOW)
                self._red_s = math.inf if command.green else time_s + YELLOW_S
        if time_s >= self._red_s:
            self._session.set_signal(SIGNAL, RAMP_LANE, RED)
            self._red_s = math.inf

    def _view(self, time_s: float, mainline_occupancy: float, queue_occupancy: float) -> View:
        waiting = self._session.vehicles_on(RAMP_LANE)
        passed, self._on_ramp = len(self._on_ramp - waiting), waiting
        seen = Detectors(mainline_occupancy, queue_occupancy, passed)
        self.readings.append(DetectorReading(time_s, mainline_occupancy, queue_occupancy, passed))
        return View(
            time_s,
            (),
            self._nobody,
            self._nobody,
            nobody_reports,
            self._fastest_mps,
            self._rules,
            self._packed,
            seen,
        )


def nobody_reports() -> Reports:
    """Returns the reports of no vehicles."""
    nothing = np.empty(0)
    return Reports(nothing, nothing, nothing, nothing)
