"""What automated vehicles among drivers keep, are, and look like to SUMO's drivers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.coordination.plant import Arrival
from coramp.mixed.laws import LANE_END_M, FollowingLaw, OnBoardLaws, SafetyLaw, SequenceLaw
from coramp.mixed.users import Gaps, MixedRoad
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation
from coramp.vehicles.traits import Traits
from coramp.worlds.faults.actuators import SlowActuators
from coramp.worlds.sumo.demand import Automated, automated_cruise_mps
from coramp.worlds.sumo.road_users import Abilities

MORE_BEHIND_DRIVER_M, MORE_BEHIND_DRIVER_S = 0.5, 0.15
"""How much more than behind an automated vehicle one keeps behind a driver."""
MORE_FOR_DRIVER_S = 0.25
"""How much more than drivers keep on average room for one who merges has."""
KEPT_HALFWAY = SequenceLaw().slowest_share
"""Half-way along the acceleration lane a vehicle may still have this share of the mainline's speed.

That is what vehicles behind slow down to for it.
"""
TRUCK_BRAKING_MPS2 = 5.0
"""What the brakes of a heavy vehicle must do (UN Regulation 13, type 0 test)."""
YIELDED_TO = 'lcCooperative="1"'
"""SUMO's drivers yield to it as to one another."""


def kept_gap(scenario: Scenario, law: SafetyLaw, delay_s: float) -> tuple[float, float]:
    """Returns the s_0 (m) and T (s) that automated vehicles keep behind one another.

    Those of ``[safety]``, and at one speed no less than the law on board lets them come near: its
    margin, and what is driven in its reaction time and in ``delay_s``, until a command acts.
    """
    safety = scenario.safety
    return (
        max(safety.standstill_gap_m, law.margin_m),
        max(safety.time_gap_s, law.reaction_s + delay_s),
    )


def gaps_of(kept: tuple[float, float], drivers: DriverPopulation) -> Gaps:
    """Returns which gaps vehicles keep, with what automated ones keep behind one another."""
    own_m, own_s = kept
    theirs_m, theirs_s = drivers.min_gap_m, drivers.mean_tau_s
    return Gaps(
        behind_automated_m=own_m,
        behind_automated_s=own_s,
        behind_driver_m=own_m + MORE_BEHIND_DRIVER_M,
        behind_driver_s=own_s + MORE_BEHIND_DRIVER_S,
        of_driver_m=theirs_m,
        of_driver_s=theirs_s,
        for_driver_m=theirs_m,
        for_driver_s=theirs_s + MORE_FOR_DRIVER_S,
        least_of_driver_s=min(drivers.taus_s),
    )


def safety_law_of(scenario: Scenario, period_s: float) -> SafetyLaw:
    """Returns what automated vehicles keep on board on this road, commanded once a period.

    They react no sooner than at their next command. Drivers move in Euler steps, in which one
    that brakes from v comes to a stand v h / 2 earlier than by v^2 / (2 b). Where the mainline is
    fast and the acceleration lane short, who is to merge relies on harder braking before its end.
    """
    law = SafetyLaw().on(scenario.road.assumed_braking_mps2)
    shorter_m = 0.5 * scenario.mainline.limit_mps * scenario.control.step_s
    end_m = scenario.ramp.acceleration_lane_m - LANE_END_M
    halfway_mps = KEPT_HALFWAY * scenario.mainline.speed_mps
    return law._replace(
        reaction_s=max(law.reaction_s, period_s),
        margin_m=max(law.margin_m, shorter_m),
        lane_end_m=end_m,
        stop_mps2=max(law.stop_mps2, min(law.driver_mps2, halfway_mps**2 / end_m)),
    )


def laws_of(
    scenario: Scenario, drivers: DriverPopulation, period_s: float, delay_s: float
) -> OnBoardLaws:
    """Returns all that automated vehicles drive by among drivers.

    They are commanded once each period; a command acts ``delay_s`` later.
    """
    law = safety_law_of(scenario, period_s)
    return OnBoardLaws(
        gaps_of(kept_gap(scenario, law, delay_s), drivers),
        FollowingLaw(),
        law,
        MixedRoad(scenario.mainline.speed_mps, scenario.ramp.speed_mps, scenario.ramp.limit_mps),
        period_s,
    )


def automated_types(
    scenario: Scenario, automated: BoolArray, period_s: float, delay_s: float
) -> Automated:
    """Returns how SUMO's drivers know automated vehicles: by the gaps that these keep at least.

    They are commanded once each ``period_s``; ``delay_s`` is the time until a command acts. SUMO
    lets a vehicle enter at such gaps, too.
    """
    kept_m, kept_s = kept_gap(scenario, safety_law_of(scenario, period_s), delay_s)
    return Automated(automated, kept_s, kept_m, YIELDED_TO)


@dataclass(frozen=True)
class Able:
    """What vehicles are and can do, one entry an arrival; ``number`` tells them by their names."""

    number: Mapping[str, int]
    automated: BoolArray
    length_m: FloatArray
    cruise_mps: FloatArray
    acceleration_mps2: FloatArray
    power_wpkg: FloatArray
    braking_mps2: FloatArray

    @cached_property
    def columns(self) -> Abilities:
        """All of it but names, for kernels."""
        return Abilities(
            self.automated,
            self.length_m,
            self.cruise_mps,
            self.acceleration_mps2,
            self.power_wpkg,
            self.braking_mps2,
        )

    @classmethod
    def of(cls, scenario: Scenario, arrivals: Sequence[Arrival], automated: BoolArray) -> "Able":
        """Returns what the vehicles of these arrivals can do; the law's braking is the most."""
        usual = scenario.usual_traits(0.0)
        traits: list[Traits] = [a.traits or usual for a in arrivals]
        most_mps2 = SafetyLaw().on(scenario.road.assumed_braking_mps2).braking_mps2
        brakes = [
            most_mps2 if np.isinf(t.braking_mps2) else max(t.braking_mps2, TRUCK_BRAKING_MPS2)
            for t in traits
        ]
        return cls(
            {a.vehicle_id: k for k, a in enumerate(arrivals)},
            automated,
            np.array([a.length_m for a in arrivals], np.float64),
            np.array([automated_cruise_mps(scenario, a) for a in arrivals], np.float64),
            np.array([t.acceleration_mps2 for t in traits], np.float64),
            np.array([t.power_wpkg for t in traits], np.float64),
            np.minimum(most_mps2, np.array(brakes, np.float64)),
        )


def actuators_of(scenario: Scenario, vehicles: int) -> SlowActuators:
    """Returns how automated vehicles follow accelerations on this road."""
    step_s, most_mps2 = scenario.control.step_s, scenario.road.most_braking_mps2
    return SlowActuators(scenario.actuators, vehicles, step_s, most_mps2)
