"""The loop of a road whose vehicles take no commands: readings of its loops in, signals out."""

import numpy as np

from coramp.coordination.ledger import Ledger
from coramp.messages.commands import SetSignal
from coramp.messages.events import DetectorReading
from coramp.road.rules import Rules, packed
from coramp.strategies.base import Decider, Detectors, Memory, Reports, SetRampSignal, View


class MeteredRoad:
    """Asks a strategy that meters the ramp at every reading."""

    def __init__(self, strategy: Decider, rules: Rules, fastest_entry_mps: float) -> None:
        self._strategy = strategy
        self._rules, self._packed = rules, packed(rules)
        self._fastest_mps = fastest_entry_mps
        self._nobody = Ledger(rules.road.mainline_speed_mps, rules.road.mainline_end_m).fleet
        self._memory: Memory = None

    def handle(self, reading: DetectorReading) -> tuple[SetSignal, ...]:
        """Returns which colours the strategy commands when it is told of a reading."""
        decision = self._strategy.decide(self._view(reading), self._memory)
        self._memory = decision.memory
        step = round(reading.time_s / self._rules.control.step_s)
        signals = (c for c in decision.commands if isinstance(c, SetRampSignal))
        return tuple(SetSignal(step, signal.green) for signal in signals)

    def _view(self, reading: DetectorReading) -> View:
        return View(
            reading.time_s,
            (),
            self._nobody,
            self._nobody,
            nobody_reports,
            self._fastest_mps,
            self._rules,
            self._packed,
            Detectors(reading.mainline_occupancy, reading.queue_occupancy, reading.passed_veh),
        )


def nobody_reports() -> Reports:
    """Returns the reports of no vehicles."""
    nothing = np.empty(0)
    return Reports(nothing, nothing, nothing, nothing)
