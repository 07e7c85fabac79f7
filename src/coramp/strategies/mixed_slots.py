"""Mixed traffic: automated vehicles make room for one another, and for drivers who merge."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from coramp.mixed.courtesy import steered_mps2
from coramp.mixed.laws import CourtesyLaws, FollowingLaw, SequenceLaw
from coramp.mixed.situation import MixedSituation, Places, Steering
from coramp.strategies.base import Decision, EntryPolicy, Memory, View
from coramp.strategies.parameters import choice, parameter
from coramp.strategies.slots import Slots

UNKNOWN = -2
"""Nobody's number: a vehicle that has no place yet."""
FIRST_WEIGHT = 20.0
"""A metre that the stream with priority falls back counts as much as this many of the other's."""


@dataclass(frozen=True)
class MixedSlots:
    """Each ramp vehicle, driver or not, gets a place in the mainline's order.

    Automated vehicles leave room at these places; drivers are predicted, never commanded. Where
    all vehicles are automated this is ``slots``.
    """

    name: ClassVar[str] = "mixed-slots"
    summary: ClassVar[str] = "slots among drivers: automated vehicles leave room for who merges"
    cooperative: ClassVar[bool] = True
    entry_policy: ClassVar[EntryPolicy] = Slots.entry_policy

    order: str = choice(
        "least-cost", "mainline-first", "ramp-first", meaning="who falls back where both could"
    )
    decision_s: float = parameter(0.2, 0.1, 0.5, meaning="time between two decisions")
    own_weight: float = parameter(
        2.0, 0.1, 20.0, meaning="cost of a metre that the ramp vehicle itself falls back"
    )
    driver_weight: float = parameter(
        1.5, 0.1, 20.0, meaning="cost of a metre that a driver falls back; 1 for automated ones"
    )

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns what ``slots`` decides: here all vehicles are automated."""
        return self._slots.decide(view, memory)

    @property
    def _slots(self) -> Slots:
        order = "first-come" if self.order == "least-cost" else self.order
        return Slots(order=order)

    def steer(self, situation: MixedSituation, places: Places) -> Steering:
        """Returns how much each automated vehicle may speed up, and where merges are asked for."""
        users, known = situation.users, dict(places)
        laws = CourtesyLaws(
            situation.gaps, self._law, FollowingLaw(), situation.road, situation.period_s
        )
        ramp = ~users.on_mainline
        there, before = np.flatnonzero(ramp), np.full(len(ramp), UNKNOWN)
        numbers = users.number[there].tolist()
        before[there] = [known.get(number, UNKNOWN) for number in numbers]
        most_mps2, behind = steered_mps2(users, before, situation.around.leader, laws)
        now = zip(numbers, behind[there].tolist(), strict=True)
        return Steering(most_mps2, ramp & users.automated, tuple(now))

    @cached_property
    def _law(self) -> SequenceLaw:
        law = SequenceLaw(own_weight=self.own_weight, driver_weight=self.driver_weight)
        if self.order == "mainline-first":
            return law._replace(driver_weight=FIRST_WEIGHT, own_weight=1.0 / FIRST_WEIGHT)
        if self.order == "ramp-first":
            return law._replace(own_weight=FIRST_WEIGHT)
        return law
