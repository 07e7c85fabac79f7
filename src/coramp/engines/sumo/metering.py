"""A signal at the ramp and loops on the road, for strategies that meter ordinary drivers."""

import math

import numpy as np

from coramp.coordination.ledger import Ledger
from coramp.core.rules import packed
from coramp.engines.sumo.session import GREEN, RED, YELLOW, Session
from coramp.scenario import Scenario
from coramp.strategies.base import Decider, Detectors, Memory, Reports, SetRampSignal, View

MAINLINE_LOOP, QUEUE_LOOP = "mainline", "queue"
QUEUE_LOOP_M = 20.0
"""How far behind its start the ramp has the loop that sees a queue too long for it."""
SIGNAL, RAMP_LANE = "nose", "ramp_0"
YELLOW_S = 2.0
"""Between green and red; who cannot stop in comfort by then goes on."""


def loops(scenario: Scenario, period_s: float) -> str:
    """Returns SUMO's file of loops: beside the acceleration lane and at the ramp's start."""
    places = (
        (MAINLINE_LOOP, "merge_1", scenario.detector_station_m),
        (QUEUE_LOOP, RAMP_LANE, min(QUEUE_LOOP_M, -0.25 * scenario.ramp.start_m)),
    )
    lines = [
        f'  <inductionLoop id="{name}" lane="{lane}" pos="{place_m!r}" period="{period_s!r}" '
        'file="NUL"/>'
        for name, lane, place_m in places
    ]
    return "\n".join(["<additional>", *lines, "</additional>", ""])


class Meter:
    """Asks a strategy once a period, with what the loops tell, and sets the signal."""

    def __init__(self, session: Session, scenario: Scenario, strategy: Decider) -> None:
        self._session = session
        self._strategy = strategy
        self._memory: Memory = None
        rules = scenario.rules()
        self._rules, self._packed = rules, packed(rules)
        self._fastest_mps = scenario.fastest_mainline_entry_mps
        self._nobody = Ledger(rules.road.mainline_speed_mps, rules.road.mainline_end_m).fleet
        self._red_s = math.inf
        self._on_ramp: set[str] = set()
        session.set_signal(SIGNAL, RAMP_LANE, GREEN)

    def decide(self, time_s: float) -> None:
        """Asks the strategy and does what it says."""
        decision = self._strategy.decide(self._view(time_s), self._memory)
        self._memory = decision.memory
        for command in decision.commands:
            if isinstance(command, SetRampSignal):
                self._session.set_signal(SIGNAL, RAMP_LANE, GREEN if command.green else YELLOW)
                self._red_s = math.inf if command.green else time_s + YELLOW_S
        if time_s >= self._red_s:
            self._session.set_signal(SIGNAL, RAMP_LANE, RED)
            self._red_s = math.inf

    def _view(self, time_s: float) -> View:
        session = self._session
        waiting = session.vehicles_on(RAMP_LANE)
        passed, self._on_ramp = len(self._on_ramp - waiting), waiting
        seen = Detectors(
            session.loop_occupancy(MAINLINE_LOOP), session.loop_occupancy(QUEUE_LOOP), passed
        )
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
