"""Ramp metering: ALINEA at a signal before the acceleration lane, as road agencies run it.

Source: M. Papageorgiou, H. Hadj-Salem, J.-M. Blosseville, "ALINEA: a local feedback control law for
on-ramp metering", Transp. Res. Record 1320, 1991; queue override and bounds as in I. Papamichail,
M. Papageorgiou et al., Transp. Res. Record 2178, 2010 (HERO).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from coramp.strategies.base import Decision, Detectors, Memory, ReleaseToDriver, SetRampSignal, View
from coramp.strategies.metering import Metered, RampSeen, Update
from coramp.strategies.parameters import parameter

SECONDS_AN_HOUR = 3600.0


class Metering(NamedTuple):
    """What ALINEA remembers: its rate (veh/h), its next update, sums since the last, the signal."""

    rate_veh_h: float
    update_s: float
    occupancy: float
    queue: float
    samples: int
    green: bool
    next_green_s: float


def with_sample(state: Metering, seen: Detectors) -> Metering:
    """Returns the state with what detectors told added to its sums."""
    return state._replace(
        occupancy=state.occupancy + seen.mainline_occupancy,
        queue=state.queue + seen.queue_occupancy,
        samples=state.samples + 1,
    )


def renewed(state: Metering, rate_veh_h: float, update_s: float) -> Metering:
    """Returns the state with a new rate, and sums that begin anew."""
    return state._replace(
        rate_veh_h=rate_veh_h, update_s=update_s, occupancy=0.0, queue=0.0, samples=0
    )


class RampMemory(NamedTuple):
    """What is remembered of one of several ramps: its meter, and who arrived since its update."""

    meter: Metering
    arrived_veh: int = 0

    def with_seen(self, ramp: RampSeen) -> "RampMemory":
        """Returns it with what a ramp's detectors told."""
        arrived_veh = self.arrived_veh + ramp.arrived_veh
        return RampMemory(with_sample(self.meter, ramp.detectors), arrived_veh)

    def measured(self, place: int, ramp: RampSeen, since_s: float) -> Update:
        """Returns what an update of the rate rests on, with the rate as it was."""
        meter = self.meter
        return Update(
            ramp=place,
            occupancy_percent=100.0 * meter.occupancy / meter.samples,
            queue_percent=100.0 * meter.queue / meter.samples,
            arrivals_veh_h=self.arrived_veh * SECONDS_AN_HOUR / since_s,
            queue_veh=ramp.queue_veh,
            room_veh=ramp.room_veh,
            rate_veh_h=meter.rate_veh_h,
            master=place,
        )


class RampsMemory(NamedTuple):
    """What is remembered of several ramps, and how their meters are coordinated, if they are."""

    ramps: tuple[RampMemory, ...]
    coordinated: Any = None


@dataclass(frozen=True)
class Alinea:
    """The metered flow follows the occupancy of the mainline beside the acceleration lane.

    ``q(k) = q(k-1) + K (o_target - o(k-1))``, q bounded each time, o in % over the last update
    interval. While the detector at the ramp's upstream end is occupied for longer than its
    threshold the ramp is let go (queue override). One vehicle a green: green until one has passed,
    then red until ``3600 / q`` s after the last green was due, longer for those who pass on yellow.
    At the highest rate it stays green.
    """

    name: ClassVar[str] = "alinea"
    summary: ClassVar[str] = "ramp metering by a signal, with SUMO's own drivers"
    cooperative: ClassVar[bool] = False
    metered: ClassVar[bool] = True

    target_occupancy_percent: float = parameter(
        20.0, 1.0, 80.0, meaning="o_target, at the detector beside the acceleration lane"
    )
    gain_veh_h: float = parameter(70.0, 1.0, 1000.0, meaning="K, gain per % of occupancy")
    update_s: float = parameter(30.0, 5.0, 300.0, meaning="time between two updates of the rate")
    least_veh_h: float = parameter(240.0, 60.0, 3600.0, meaning="lowest rate")
    most_veh_h: float = parameter(
        1200.0, 60.0, 3600.0, meaning="highest rate; at it the signal stays green"
    )
    queue_occupancy_percent: float = parameter(
        50.0, 1.0, 100.0, meaning="at the ramp's start; above it the queue is let go"
    )
    period_s: float = parameter(1.0, 0.1, 2.0, meaning="control period of the signal")

    def problems(self) -> list[str]:
        """Returns what does not fit together: a range of rates that is none."""
        if self.least_veh_h < self.most_veh_h:
            return []
        most = f"most_veh_h, {self.most_veh_h:g}"
        return [f"least_veh_h: {self.least_veh_h:g} meters nothing; allowed is below {most}"]

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the release of subjects, or, once a period, the signal where it changes."""
        if view.subjects or view.detectors is None:
            return Decision(tuple(ReleaseToDriver(row) for row in view.subjects), (), memory)
        old = memory if isinstance(memory, Metering) else self.start(view.time_s)
        state = self.after(old, view.detectors, view.time_s)
        changed = state.green != old.green
        return Decision((SetRampSignal(state.green),) if changed else (), (), state)

    def meter(
        self, now_s: float, seen: Sequence[RampSeen], roads: Sequence[Sequence[int]], memory: Any
    ) -> Metered:
        """Returns the signals of several ramps, as ``MetersRamps`` does.

        All begin at the same time, and have their rates updated at the same time.
        """
        old = memory or RampsMemory(tuple(RampMemory(self.start(now_s)) for _ in seen))
        ramps = [own.with_seen(ramp) for own, ramp in zip(old.ramps, seen, strict=True)]
        coordinated: Any = old.coordinated
        updates: tuple[Update, ...] = ()
        if ramps and now_s >= ramps[0].meter.update_s:
            measured = [
                own.measured(k, ramp, self.update_s)
                for k, (own, ramp) in enumerate(zip(ramps, seen, strict=True))
            ]
            found, coordinated = self.rates(measured, roads, coordinated)
            updates = tuple(self._let_go(update) for update in found)
            ramps = [
                RampMemory(renewed(own.meter, update.rate_veh_h, now_s + self.update_s))
                for own, update in zip(ramps, updates, strict=True)
            ]
        ramps = [
            own._replace(meter=self.with_signal(own.meter, ramp.detectors.passed_veh, now_s))
            for own, ramp in zip(ramps, seen, strict=True)
        ]
        green = tuple(own.meter.green for own in ramps)
        return Metered(green, RampsMemory(tuple(ramps), coordinated), updates)

    def rates(
        self,
        measured: Sequence[Update],
        roads: Sequence[Sequence[int]],  # noqa: ARG002 - for those who coordinate
        coordinated: Any,
    ) -> tuple[list[Update], Any]:
        """Returns the updates with their rates: here each ramp is metered by itself."""
        return [
            update._replace(
                rate_veh_h=self.next_rate_veh_h(update.rate_veh_h, update.occupancy_percent)
            )
            for update in measured
        ], coordinated

    def _let_go(self, update: Update) -> Update:
        """The queue override."""
        if update.queue_percent <= self.queue_occupancy_percent:
            return update
        return update._replace(rate_veh_h=self.most_veh_h, let_go=True)

    def after(self, state: Metering, seen: Detectors, now_s: float) -> Metering:
        """Returns the state once detectors have told what they saw."""
        updated = self._updated(with_sample(state, seen), now_s)
        return self.with_signal(updated, seen.passed_veh, now_s)

    def start(self, now_s: float) -> Metering:
        """Returns the state before the first sample: the ramp is let go."""
        return Metering(self.most_veh_h, now_s + self.update_s, 0.0, 0.0, 0, True, now_s)

    def next_rate_veh_h(self, rate_veh_h: float, occupancy_percent: float) -> float:
        """Returns q(k) from q(k-1) and the occupancy (%) since."""
        change = self.gain_veh_h * (self.target_occupancy_percent - occupancy_percent)
        return min(self.most_veh_h, max(self.least_veh_h, rate_veh_h + change))

    def with_signal(self, state: Metering, passed_veh: int, now_s: float) -> Metering:
        """Returns the state with the signal as it is to be until the next period."""
        if state.rate_veh_h >= self.most_veh_h:
            return state._replace(green=True, next_green_s=now_s)
        cycle_s = SECONDS_AN_HOUR / state.rate_veh_h
        if state.green and passed_veh > 0:
            green_again_s = state.next_green_s + cycle_s * passed_veh
            return state._replace(green=False, next_green_s=max(now_s, green_again_s))
        if passed_veh > 0:  # over yellow
            return state._replace(next_green_s=state.next_green_s + cycle_s * passed_veh)
        if not state.green and now_s >= state.next_green_s:
            due_s = max(state.next_green_s, now_s - cycle_s)
            return state._replace(green=True, next_green_s=due_s)
        return state

    def _updated(self, state: Metering, now_s: float) -> Metering:
        if now_s < state.update_s:
            return state
        occupancy_percent = 100.0 * state.occupancy / state.samples
        queue_percent = 100.0 * state.queue / state.samples
        rate = self.next_rate_veh_h(state.rate_veh_h, occupancy_percent)
        if queue_percent > self.queue_occupancy_percent:
            rate = self.most_veh_h
        return renewed(state, rate, now_s + self.update_s)
