"""The numbers of the laws of mixed traffic."""

from typing import NamedTuple

from coramp.mixed.users import Gaps, MixedRoad

LANE_END_M = 3.0
"""An automated vehicle that has not merged stands so far before the acceleration lane ends."""


class FollowingLaw(NamedTuple):
    """How an automated vehicle follows: a = k_g (gap - s_0 - T v) + k_v (v_l - v) + k_a a_l.

    v_l and a_l are the leader's speed and acceleration. ``gap_gain_ps2`` is k_g, ``speed_gain_ps``
    k_v and ``feed_forward`` k_a for the vehicle ahead in its lane;
    ``courtesy_gap_gain_ps2`` and ``courtesy_speed_gain_ps`` are those for one that is yet to merge,
    or behind which it is itself to merge. For these it brakes by at most ``courtesy_mps2``, and by
    ``early_share`` of that while the merge is more than ``early_s`` away. ``speed_up_mps2`` is its
    acceleration in a lane, ``merge_mps2`` that on the acceleration lane.
    """

    gap_gain_ps2: float = 0.22
    speed_gain_ps: float = 0.85
    feed_forward: float = 0.6
    courtesy_gap_gain_ps2: float = 0.2
    courtesy_speed_gain_ps: float = 1.0
    courtesy_mps2: float = 2.5
    early_share: float = 0.27
    early_s: float = 14.0
    speed_up_mps2: float = 2.5
    merge_mps2: float = 2.05


class SequenceLaw(NamedTuple):
    """How a vehicle on the ramp finds its place in the mainline's order.

    A place costs ``own_weight`` a metre that the vehicle falls back itself, and a metre that the
    vehicles behind fall back: 1 for an automated one, ``driver_weight`` for a driver, so far as the
    fall runs on through at most ``deep`` of them. The place that it has counts ``hysteresis_m``
    less. The mean speed of the lane from ``behind_m`` behind it to ``ahead_m`` before it is that of
    its virtual station. Courtesy leaves vehicles at ``slowest_share`` of the lane's speed, on the
    ramp at ``slowest_ramp_share``; close to the lane's end, from ``urgent_m`` on, at
    ``urgent_mps``.
    """

    own_weight: float = 2.0
    driver_weight: float = 1.5
    hysteresis_m: float = 2.0
    deep: float = 6.0
    behind_m: float = 100.0
    ahead_m: float = 117.0
    slowest_share: float = 0.63
    slowest_ramp_share: float = 0.9
    urgent_m: float = 100.0
    urgent_mps: float = 3.0


class SafetyLaw(NamedTuple):
    """What a vehicle keeps on board, whatever it is told, and when it changes lanes.

    It stays behind a leader that brakes at ``braking_mps2`` if it reacts after ``reaction_s`` and
    brakes at that rate too, with ``margin_m`` to spare; ``hardest_mps2`` is what its brakes can do.
    It can stop with ``stop_mps2`` before ``lane_end_m``. A lane change leaves a driver behind
    s_0 + T v and what braking at ``driver_mps2`` takes, less ``relax_m``, and less
    ``relax_at_end_m`` more where the lane ends; one who is slower is judged by ``driver_dry_mps2``
    on any road. It asks nobody automated for more than ``gentle_mps2``, at the lane's end
    ``gentle_at_end_mps2`` more.
    """

    braking_mps2: float = 6.0
    reaction_s: float = 0.3
    margin_m: float = 1.2
    hardest_mps2: float = 8.0
    stop_mps2: float = 1.65
    lane_end_m: float = 197.0
    driver_mps2: float = 4.5
    driver_dry_mps2: float = 4.5
    relax_m: float = 0.96
    relax_at_end_m: float = 4.0
    gentle_mps2: float = 0.68
    gentle_at_end_mps2: float = 5.0

    def on(self, most_braking_mps2: float) -> "SafetyLaw":
        """Returns the law on a road on which nobody is taken to brake harder than that."""
        return self._replace(
            braking_mps2=min(self.braking_mps2, most_braking_mps2),
            stop_mps2=min(self.stop_mps2, most_braking_mps2),
            driver_mps2=min(self.driver_mps2, most_braking_mps2),
        )


class OnBoardLaws(NamedTuple):
    """All that a vehicle drives by on board, once each ``period_s``."""

    gaps: Gaps
    following: FollowingLaw
    safety: SafetyLaw
    road: MixedRoad
    period_s: float


class CourtesyLaws(NamedTuple):
    """All that places on the ramp, and the room that is left there, follow from."""

    gaps: Gaps
    sequence: SequenceLaw
    following: FollowingLaw
    road: MixedRoad
    period_s: float
