"""What the loop tells a world, and a channel that keeps it: at once, and nothing is lost.

The channel stands between coordinator and world only where messages are kept; else the coordinator
calls the world itself. What vehicles tell does not pass through it.
"""

import math
from typing import Protocol

from coramp._kernel import FloatArray
from coramp.messages.commands import Enter, Follow, WorldCommand
from coramp.messages.events import RequestToEnter


class Plant(Protocol):
    """Carries vehicles. Steps count the control clock; step k is at ``k * step_s``."""

    def advance(self, step: int) -> None:
        """Lets time pass up to ``step``; what is commanded next takes effect from there."""
        ...

    def enter(self, row: int, arrival: RequestToEnter, step: int) -> None:
        """Puts a vehicle with its front at the start of its zone, at its entry speed."""
        ...

    def follow(
        self, row: int, pieces: FloatArray, merge_time_s: float, lane_change_s: float = math.inf
    ) -> None:
        """Makes a vehicle follow the pieces from their first time on; merge at that time.

        It begins to change to the next lane further in at ``lane_change_s``, if that is a time.
        """
        ...


class Channel:
    """Hands commands on to a world, if there is one, and keeps them in their order.

    Each arrives in the step in which it is given, and is acknowledged in it.
    """

    def __init__(self, world: Plant | None = None) -> None:
        self.commands: list[WorldCommand] = []
        self._world = world
        self._names: list[str] = []
        self._entering = -1
        self._step = 0

    def advance(self, step: int) -> None:
        """Lets time pass up to ``step``."""
        self._step = step
        if self._world is not None:
            self._world.advance(step)

    def enter(self, row: int, arrival: RequestToEnter, step: int) -> None:
        """Lets a vehicle enter; its first pieces follow."""
        self._names.append(arrival.vehicle_id)
        self._entering = row
        if self._world is not None:
            self._world.enter(row, arrival, step)

    def follow(
        self, row: int, pieces: FloatArray, merge_time_s: float, lane_change_s: float = math.inf
    ) -> None:
        """Carries a command, which for a vehicle that enters is its entry."""
        told = self._names[row], self._step, pieces.copy(), merge_time_s
        enters, self._entering = row == self._entering, -1
        self.commands.append(Enter(*told) if enters else Follow(*told, lane_change_s))
        if self._world is not None:
            self._world.follow(row, pieces, merge_time_s, lane_change_s)

    def taken(self) -> tuple[WorldCommand, ...]:
        """Returns what has been commanded since this was last asked."""
        commands, self.commands = tuple(self.commands), []
        return commands
