"""Merge-v1: ramp vehicles ask for their slots in the lane, one at a time, and share one policy.

Once Gymnasium and ``coramp`` are imported, ``gymnasium.make("coramp/Merge-v1")`` makes one.
"""

import math
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from coramp._kernel import FloatArray
from coramp.coordination.asking import AskingLoop, Requested
from coramp.coordination.guard import LONGEST_PERIOD_S
from coramp.coordination.plant import Arrival
from coramp.demand.arrivals import arrivals_of
from coramp.errors import CorampError
from coramp.kinematics.trajectory import station_and_speed
from coramp.messages.feed import RequestFeed
from coramp.metrics.delay_bound import earliest_exits_s, first_come_exits_s, lane_headway_s
from coramp.road.rules import Rules, packed
from coramp.scenarios.loading import check_one_lane, load_scenario
from coramp.strategies.asked_slot import crossings_around
from coramp.strategies.base import steps_of_period

Floats32 = npt.NDArray[np.float32]

EACH_SIDE = 3
"""So many vehicles that cross before the agent are seen, and so many that cross after it."""
FEATURES = 7 + 2 * EACH_SIDE
LATE_S, QUEUE_VEH, REFUSALS, OUTSIDE_S, AROUND_S = 60.0, 10.0, 10.0, 10.0, 5.0
"""What counts as 1 in an observation."""
TOLERANCE_S = 1.0
"""So much later than it asks for an agent may be given a slot."""
FIRST_DRAWN, LAST_DRAWN = 1_000_000, 2**31 - 1
"""Seeds of traffic that a reset without a seed draws from: smaller ones stay unseen."""
MOST_DRAWS = 1000
"""So often traffic is drawn anew for an episode before there is taken to be no agent at all."""


class MergeSlots(gymnasium.Env[Floats32, Floats32]):
    """Merging in the exact engine; a step is one decision of one ramp vehicle.

    **Agents.** Every ramp vehicle in turn, by one policy: the foremost that has no merge yet. It is
    first asked so long before its crossing in free movement as the mainline takes from its start to
    the nose, when nobody who entered there at v0 crosses after it yet, and then every ``period_s``
    until it has a merge.

    **Action**, shape (1,), from -1 to 1: by how much later than in free movement it wants to cross
    the nose, from 0 to ``longest_shift_s``. It gets the first slot up to 1 s after that which is
    safe, and for which nobody on the mainline has to move; who has yet to enter brakes as it
    enters, or waits. If there is none the wish is refused. -1 asks for nothing.

    **Fallback.** A vehicle that has been asked and has no merge merges by itself, tried at every
    step of the control clock, as soon as that is safe and holds nobody up who has yet to enter.
    Until then it goes on to its stop before the nose. So an agent that asks for nothing merges too.

    **Observation**, shape (13,), from -1 to 1: how late the agent would be in free movement (60 s);
    its station (0 at the nose, -1 at the ramp's start) and speed (v0); its refusals (10); ramp
    vehicles behind it (10); how long the first vehicle outside the mainline has waited (10 s); then
    how long after others its free movement crosses (5 s), negative for before: the three before it,
    the latest first, the three after it, the earliest first, and the last of all. In brackets: what
    counts as 1. All is cut off there, and who is not there counts as 1, or -1 if it were behind.
    Zeros without an agent.

    **Reward** of a step: minus the delay (s) that all vehicles have got since the step before, over
    the number of vehicles in the episode. A ramp vehicle without a merge counts as if it took the
    next slot behind all others. What the same vehicles lose in a queue that serves the first to
    come first is taken off as they come: that depends on the arrivals alone, and without it chance
    drowns what an action does. So an episode's sum is that queue's mean delay minus the episode's.

    **End.** Terminated once everybody has entered and has a merge, truncated after ``longest_s``.
    ``reset(seed=n)`` gives the arrivals of ``coramp run --seed n``; without a seed traffic is drawn
    from seeds above a million. ``info`` has ``time_s``, ``row``, the agent's row in the ledger of
    ``loop.coordinator`` (-1 for none), ``refused``, how many wishes so far, and ``delay_s``, the
    mean delay of all so far; after the end that of the episode.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own attribute

    def __init__(
        self,
        scenario: str = "paper",
        *,
        mainline_veh_h: float = 1800.0,
        ramp_veh_h: float = 500.0,
        time_gap_s: float = 1.0,
        horizon_s: float = 300.0,
        period_s: float = 5.0,
        longest_shift_s: float = 10.0,
        longest_s: float = 3600.0,
    ) -> None:
        """Raises CorampError for a scenario or number that cannot be."""
        _check(period_s, longest_shift_s, longest_s)
        settings = {
            "mainline.flow_veh_h": mainline_veh_h,
            "ramp.flow_veh_h": ramp_veh_h,
            "safety.time_gap_s": time_gap_s,
            "simulation.horizon_s": horizon_s,
        }
        self._scenario = load_scenario(scenario, {k: float(v) for k, v in settings.items()})
        check_one_lane(self._scenario, "the environment plans", "coramp/MixedMerge-v0")
        if self._scenario.vehicles_differ:
            raise CorampError(
                f"vehicle: the environment is for vehicles that are alike; those of {scenario} are "
                "not; allowed are types without limits of their own"
            )
        self._rules = self._scenario.rules()
        step_s = self._rules.control.step_s
        self._period = steps_of_period(period_s, step_s)
        self._longest_shift_s, self._last_step = longest_shift_s, round(longest_s / step_s)
        self._lost_s = 0.0
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
        self.observation_space = spaces.Box(-1.0, 1.0, (FEATURES,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Returns the first observation: a ramp vehicle is asked for its slot."""
        super().reset(seed=seed, options=options)
        traffic = self._drawn() if seed is None else seed
        for _ in range(MOST_DRAWS):
            self._begin(traffic)
            if self.loop.row >= 0:
                return self._observation(), self._info()
            traffic = self._drawn()
        raise CorampError(
            f"ramp_veh_h: no ramp vehicle came in {MOST_DRAWS} draws of "
            f"{self._scenario.simulation.horizon_s:g} s; allowed are flows and horizons with "
            "somebody on the ramp"
        )

    def step(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        """Asks for the agent's slot and drives on to the next question; see the class."""
        share = float(np.asarray(action, np.float64).reshape(-1)[0])
        if not math.isfinite(share):
            raise CorampError("action: holds a number that is not finite")
        if share > -1.0:
            self.loop.ask_for(0.5 * (min(share, 1.0) + 1.0) * self._longest_shift_s, TOLERANCE_S)
        self.loop.go_on(self._last_step)
        before_s, self._lost_s = self._lost_s, self._lost_so_far_s()
        reward = (before_s - self._lost_s) / len(self.arrivals)
        over = self.loop.step >= self._last_step
        return self._observation(), reward, self.loop.row < 0 and not over, over, self._info()

    def _drawn(self) -> int:
        return int(self.np_random.integers(FIRST_DRAWN, LAST_DRAWN))

    def _begin(self, traffic: int) -> None:
        """Starts on new traffic and drives on to the first question, if there is one."""
        self.arrivals = arrivals_of(self._scenario, traffic)
        self.loop = AskingLoop(
            self._rules,
            RequestFeed(self.arrivals),
            self._scenario.fastest_mainline_entry_mps,
            self._period,
        )
        self._served_s = served_delay_s(self.loop.requested, self.arrivals, self._rules)
        self._lost_s = 0.0
        self.loop.go_on(self._last_step)

    def _lost_so_far_s(self) -> float:
        """Returns the delay (s) of all so far beyond that of the same vehicles in a queue."""
        heard = self.loop.requested.scheduled_s <= self.loop.time_s
        return self.loop.delay_s() - float(self._served_s[heard].sum())

    def _observation(self) -> Floats32:
        """Returns what the agent sees, zeros without one."""
        loop, row, features = self.loop, self.loop.row, np.zeros(FEATURES)
        if row < 0:
            return features.astype(np.float32)
        coordinator, road = loop.coordinator, self._rules.road
        ledger, now_s = coordinator.ledger, loop.time_s
        station_m, speed_mps = station_and_speed(ledger.way(row), now_s)
        outside = coordinator.view((), loop.step).waiting
        first = outside.first(on_ramp=False)
        crossing_s, around_s = crossings_around(
            ledger.fleet, row, now_s, EACH_SIDE, loop.packed_rules
        )
        features[:6] = (
            loop.late_s(row) / LATE_S,
            -station_m / road.ramp_start_m,
            speed_mps / road.mainline_speed_mps,
            loop.own_refused / REFUSALS,
            (len(loop.waiting()) - 1) / QUEUE_VEH,
            (now_s - outside.since_s[first]) / OUTSIDE_S if first >= 0 else 0.0,
        )
        features[6:] = (crossing_s - around_s) / AROUND_S
        return np.clip(features, -1.0, 1.0).astype(np.float32)

    def _info(self) -> dict[str, Any]:
        return {
            "time_s": self.loop.time_s,
            "row": self.loop.row,
            "refused": self.loop.refused,
            "delay_s": self.loop.delay_s() / len(self.arrivals),
        }


def served_delay_s(requested: Requested, arrivals: Sequence[Arrival], rules: Rules) -> FloatArray:
    """Returns each vehicle's delay (s) where the lane serves all first come, first served.

    That is Lindley's recursion (``metrics.delay_bound``): it depends on the arrivals alone.
    """
    if not arrivals:
        return np.empty(0)
    entry_mps = np.array([a.speed_mps for a in arrivals])
    shortest_m = min(a.length_m for a in arrivals)
    earliest_s = earliest_exits_s(
        requested.scheduled_s, requested.on_ramp, entry_mps, packed(rules)
    )
    exit_s = first_come_exits_s(earliest_s, lane_headway_s(shortest_m, rules))
    return exit_s - requested.scheduled_s - requested.free_flow_s


def _check(period_s: float, longest_shift_s: float, longest_s: float) -> None:
    """Raises CorampError with a line for each setting that cannot be."""
    wrong = {
        f"period_s: {period_s:g} cannot be; allowed is above 0, up to {LONGEST_PERIOD_S:g}": not (
            0.0 < period_s <= LONGEST_PERIOD_S
        ),
        f"longest_shift_s: {longest_shift_s:g} cannot be; allowed is above 0, up to 60": not (
            0.0 < longest_shift_s <= 60.0
        ),
        f"longest_s: {longest_s:g} cannot be; allowed is above 0": not 0.0 < longest_s < math.inf,
    }
    if told := [line for line, is_wrong in wrong.items() if is_wrong]:
        raise CorampError(*told)
