"""Nobody coordinates: SUMO's own drivers (Krauss and LC2013)."""

from dataclasses import dataclass
from typing import ClassVar

from coramp.strategies.base import Decision, Memory, ReleaseToDriver, View


@dataclass(frozen=True)
class Uncontrolled:
    """Leaves every vehicle to its driver."""

    name: ClassVar[str] = "uncontrolled"
    summary: ClassVar[str] = "SUMO's own drivers, Krauss following and LC2013 lane changing"
    cooperative: ClassVar[bool] = False

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the release of all subjects."""
        return Decision(tuple(ReleaseToDriver(row) for row in view.subjects), (), memory)
