"""A coordinator that is told of events as they happen: ``handle(events, step) -> commands``."""

from collections.abc import Callable, Iterable
from typing import get_args

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.drivers import DriverRoad
from coramp.errors import CorampError
from coramp.messages.channel import Channel
from coramp.messages.commands import WorldCommand
from coramp.messages.events import Acknowledgement, DetectorReading, Event, Report, RequestToEnter
from coramp.messages.feed import RequestFeed
from coramp.road.rules import Rules
from coramp.strategies.base import Decider, is_metered


class Service:
    """Runs one strategy for a world that grows step by step.

    Decisions are those of a run that has all requests beforehand, bit for bit: no request is read
    before its step. Who asked to enter takes commands; its reports and acknowledgements change
    nothing while the channel is perfect: it is where it promised to be, and has what it was sent.
    Who reports and never asked to enter is a driver. ``ask_drivers`` has all drivers report where
    they are, for a strategy that looks at them.
    """

    def __init__(
        self,
        strategy: Decider,
        rules: Rules,
        fastest_entry_mps: float,
        ask_drivers: Callable[[], Iterable[Report]] | None = None,
    ) -> None:
        self._feed, self._channel = RequestFeed(), Channel()
        self._drivers = DriverRoad(is_metered(strategy), ask_drivers)
        self._step, self._step_s = -1, rules.control.step_s
        self._asked: set[str] = set()
        self._lanes = rules.road.lanes
        self.coordinator = Coordinator(
            strategy, rules, self._feed, fastest_entry_mps, self._channel, self._drivers
        )
        self.coordinator.expect_arrivals()

    def handle(self, events: Iterable[Event], step: int) -> tuple[WorldCommand, ...]:
        """Returns what is commanded up to and including ``step``, the events being those by then.

        A reading of the road's loops has the strategy asked at its step. Raises CorampError for a
        step that has been handled, for a request or reading of such a step or of one that is yet to
        come, and for what is no event.
        """
        if step <= self._step:
            raise CorampError(f"step {step} has been handled; allowed is {self._step + 1} or later")
        readings = []
        for event in events:
            if isinstance(event, RequestToEnter):
                self._hear(event, step)
            elif isinstance(event, Report) and event.vehicle_id not in self._asked:
                self._drivers.hear(event)
            elif isinstance(event, DetectorReading):
                self._check_time("the road's loops: tell", round(event.time_s / self._step_s), step)
                readings.append(event)
            elif not isinstance(event, Report | Acknowledgement):
                raise CorampError(
                    f"{type(event).__name__} is no event; allowed are "
                    f"{', '.join(kind.__name__ for kind in get_args(Event))}"
                )
        self._step = step
        for reading in readings:
            self.coordinator.read(reading)
        self.coordinator.run(step)
        return (*self._channel.taken(), *self._drivers.taken())

    def _hear(self, request: RequestToEnter, step: int) -> None:
        self._check_time(f"{request.vehicle_id}: asks to enter", request.step, step)
        most = 0 if request.on_ramp else self._lanes - 1
        if not 0 <= request.lane <= most:
            asked = f"{request.vehicle_id}: asks to enter on lane {request.lane}"
            raise CorampError(f"{asked}; allowed is 0 to {most}")
        try:
            self._feed.append(request)
        except ValueError as error:
            raise CorampError(str(error)) from None
        self._asked.add(request.vehicle_id)

    def _check_time(self, what: str, at_step: int, step: int) -> None:
        if not self._step < at_step <= step:
            allowed = f"allowed is {self._step + 1} to {step}"
            raise CorampError(f"{what} at step {at_step}; {allowed}")
