"""A coordinator that is told of events as they happen: ``handle(events, step) -> commands``."""

from collections.abc import Iterable

from coramp.coordination.coordinator import Coordinator
from coramp.errors import CorampError
from coramp.messages.channel import Channel
from coramp.messages.commands import Command
from coramp.messages.events import Event, RequestToEnter
from coramp.messages.feed import RequestFeed
from coramp.road.rules import Rules
from coramp.strategies.base import Decider


class Service:
    """Runs one strategy for a world that grows step by step.

    Decisions are those of a run that has all requests beforehand, bit for bit: no request is read
    before its step. Reports, acknowledgements and readings change nothing while the channel is
    perfect: vehicles are where they promised to be, and have what they were sent.
    """

    def __init__(self, strategy: Decider, rules: Rules, fastest_entry_mps: float) -> None:
        self._feed, self._channel = RequestFeed(), Channel()
        self._step = -1
        self.coordinator = Coordinator(
            strategy, rules, self._feed, fastest_entry_mps, self._channel
        )
        self.coordinator.expect_arrivals()

    def handle(self, events: Iterable[Event], step: int) -> tuple[Command, ...]:
        """Returns what is commanded up to and including ``step``, the events being those by then.

        Raises CorampError for a step that has been handled, and for a request of such a step or of
        one that is yet to come.
        """
        if step <= self._step:
            raise CorampError(f"step {step} has been handled; allowed is {self._step + 1} or later")
        for event in events:
            if isinstance(event, RequestToEnter):
                self._hear(event, step)
        self._step = step
        self.coordinator.run(step)
        return self._channel.taken()

    def _hear(self, request: RequestToEnter, step: int) -> None:
        if not self._step < request.step <= step:
            raise CorampError(
                f"{request.vehicle_id}: asks to enter at step {request.step}; "
                f"allowed is {self._step + 1} to {step}"
            )
        try:
            self._feed.append(request)
        except ValueError as error:
            raise CorampError(str(error)) from None
