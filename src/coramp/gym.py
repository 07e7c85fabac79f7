"""A Gymnasium environment: ramp vehicles as agents, everyone else cooperative, no simulator.

Once this module is imported, ``gymnasium.make("coramp/Merge-v0")`` makes one.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces

from coramp._kernel import FloatArray, IntArray, kernel
from coramp._registration import register
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.guard import LONGEST_PERIOD_S, strategy_to_run
from coramp.demand.arrivals import arrivals_of
from coramp.equations.ramp_acceleration import lag_m
from coramp.errors import CorampError
from coramp.kinematics.trajectory import station_and_speed
from coramp.messages.feed import RequestFeed
from coramp.road.lanes import MAINLINE, RAMP
from coramp.road.rules import Rules, packed, unpacked
from coramp.scenarios.loading import check_one_lane, load_scenario
from coramp.strategies.base import (
    Decider,
    Decision,
    DriveWithAcceleration,
    Memory,
    View,
    period_of,
    steps_of_period,
)
from coramp.strategies.feedback import virtual_platoon
from coramp.strategies.registry import strategy_named
from coramp.vehicles.fleet import Fleet
from coramp.vehicles.merge_state import is_waiting

NEIGHBOURS = 2
"""So many vehicles before the agent in the order of merging are seen, and so many behind it."""
FEATURES = 5 + 4 * NEIGHBOURS
STATION_FEATURE = 1
FARTHEST_M = 400.0
"""Who is further away, or not there at all, counts as this far away, at the lane's speed."""
WARM_UP_S = 30.0
MOST_DRAWS = 1000
"""So often traffic is drawn anew for an episode before there is taken to be no agent at all."""
ACTION_WEIGHT = 0.02
INTERVENTION_COST = 1.0


register()


class Seen(NamedTuple):
    """What agents see: a row of features a slot, 0 for slots without an agent, and their rows."""

    features: FloatArray
    rows: IntArray


class _Others:
    """The strategy of ramp vehicles that are no agents.

    Agents are never planned, and who waits behind one tries again after a while.
    """

    def __init__(self, strategy: Decider, everyone: bool) -> None:
        self.agent = -1
        self._everyone = everyone
        self._strategy = strategy

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the decision for the first subject, nothing for an agent."""
        row, *rest = view.subjects
        if self._everyone or row == self.agent:
            return Decision((), tuple((view.time_s, other) for other in rest), memory)
        decision = self._strategy.decide(view, memory)
        if decision.commands or any(other == row for _, other in decision.wakes_s):
            return decision
        again = (view.time_s + view.rules.control.retry_s, row)
        return replace(decision, wakes_s=(*decision.wakes_s, again))


class MergeEnv(gymnasium.Env[FloatArray, FloatArray]):
    """Merging onto an expressway in the exact engine; a step is ``period_s``.

    **Agents.** ``agents="one"``: the first ramp vehicle that enters after 30 s; the others follow
    the strategy ``others``. ``agents="all"``: every ramp vehicle, the foremost ``slots`` of those
    before the nose at a time, front first.

    **Action**, shape (1,) or (slots,), from -1 to 1: the acceleration for a step as a share of the
    hardest, of ``comfort_mps2`` (2.94) below 0 and of ``speed_up_mps2`` (1.5) above. The supervisor
    carries out what is safe and lets the vehicle merge as soon as that is safe; otherwise it keeps
    its last safe commitment.

    **Observation**, shape (13,) or (slots, 13), SI units: 1 if there is an agent; its station and
    speed; bumper distance to and speed of the vehicle ahead on the ramp; then for the two before
    it, the further one first, and the two behind it in the order of merging how far ahead its place
    on the mainline is (``strategies.feedback.Platoon``; negative behind), and that place's speed.
    Who is not there counts as 400 m away at the speed of the lane. Rows without an agent are 0.

    **Reward** of a step, summed over agents: the time lost (s, as a negative number) against v_R0,
    in the last step also what its committed merge will lose from there to the zone's end against
    free movement; less ``0.02 u^2 period_s``; less 1 for a command that the supervisor refused. So
    an episode's sum is, below 0, the agents' delay from where they became agents, their effort and
    their refusals; who waits outside, or behind the foremost ``slots``, is no agent yet.

    **End.** Terminated once the agent (all ramp vehicles) is past the nose, from where it drives as
    committed; truncated after ``longest_s`` (600). A merge once committed is only replaced by
    another that is safe. ``loop`` is the coordinator underneath; ``info`` has ``time_s``,
    ``interventions``, how many commands of agents were refused so far, and ``rows``, the agents'
    rows in the ledger. The same seed gives the same traffic.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own attribute

    def __init__(
        self,
        scenario: str = "paper",
        agents: str = "one",
        *,
        mainline_veh_h: float = 1800.0,
        ramp_veh_h: float = 500.0,
        horizon_s: float = 90.0,
        period_s: float = 0.5,
        slots: int = 8,
        others: str = "mainline-priority",
        longest_s: float = 600.0,
    ) -> None:
        """Raises CorampError for a scenario, strategy or number that cannot be."""
        _check(agents, horizon_s, slots, period_s, longest_s)
        flows = {"mainline.flow_veh_h": mainline_veh_h, "ramp.flow_veh_h": ramp_veh_h}
        self._scenario = load_scenario(
            scenario, {**{k: float(v) for k, v in flows.items()}, "simulation.horizon_s": horizon_s}
        )
        check_one_lane(self._scenario, "the environment plans", "coramp/MixedMerge-v0")
        if self._scenario.vehicles_differ:
            raise CorampError(
                f"vehicle: the environment is for vehicles that are alike; those of {scenario} are "
                "not; allowed are types without limits of their own"
            )
        self._rules, self._horizon_s = self._scenario.rules(), horizon_s
        self._step_s = self._rules.control.step_s
        self._period = steps_of_period(period_s, self._step_s)
        self._hold_s = self._period * self._step_s
        self._longest = round(longest_s / self._step_s)
        self._packed = packed(self._rules)
        road, accel_mps2 = self._rules.road, self._rules.motion.free_acceleration_mps2
        self._lag_m = lag_m(road.mainline_speed_mps, road.ramp_speed_mps, accel_mps2)
        self._everyone = agents == "all"
        self._slots = slots if self._everyone else 1
        self._others = others
        if not strategy_named(others).cooperative or period_of(self._new_others()) is not None:
            raise CorampError(f"others: {others} does not plan; choose a planning strategy")
        self._actions = spaces.Box(-1.0, 1.0, (self._slots,), np.float64)
        shape = (self._slots, FEATURES) if self._everyone else (FEATURES,)
        self._observations = spaces.Box(*_bounds(self._rules, shape), dtype=np.float64)
        self.action_space, self.observation_space = self._actions, self._observations
        self._seen = Seen(np.zeros((self._slots, FEATURES)), np.empty(0, np.int64))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Returns the first observation: an agent has just entered the ramp."""
        super().reset(seed=seed, options=options)
        for _ in range(MOST_DRAWS):
            traffic = int(self.np_random.integers(2**31 - 1))
            if self._begin(traffic):
                return self._observation(), self._info()
        raise CorampError(
            f"ramp_veh_h: no ramp vehicle came in {MOST_DRAWS} draws of {self._horizon_s:g} s; "
            "allowed are flows and horizons with somebody on the ramp"
        )

    def step(self, action: FloatArray) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Drives for a period; see the class for what it returns."""
        loop, rows = self.loop, self._seen.rows.tolist()
        share = np.clip(np.asarray(action, np.float64).reshape(-1), -1.0, 1.0)
        if not np.isfinite(share).all():
            raise CorampError("action: holds a number that is not finite")
        motion = self._rules.motion
        accel_mps2 = share * np.where(share < 0.0, motion.comfort_mps2, motion.speed_up_mps2)
        pairs = zip(rows, accel_mps2.tolist(), strict=False)
        commands = [DriveWithAcceleration(row, u, self._hold_s) for row, u in pairs]
        refused = loop.drive(commands, self._now) if commands else 0
        self._interventions += refused
        before_m = self._seen.features[: len(rows), STATION_FEATURE]
        self._now += self._period
        loop.run(self._now)
        self._seen = self._look()
        reward = self._reward(rows, before_m, accel_mps2) - INTERVENTION_COST * refused
        over = self._now - self._started >= self._longest
        return self._observation(), reward, self._ended(), over, self._info()

    def _begin(self, traffic: int) -> bool:
        """Draws new traffic and lets it run until there is an agent; False where none comes."""
        self.arrivals = arrivals_of(self._scenario, traffic)
        self._interventions = 0
        self._strategy = _Others(self._new_others(), self._everyone)
        self.loop = Coordinator(
            self._strategy,
            self._rules,
            RequestFeed(self.arrivals),
            self._scenario.fastest_mainline_entry_mps,
        )
        self.loop.expect_arrivals()
        first = 0 if self._everyone else round(WARM_UP_S / self._step_s)
        steps = [a.step for a in self.arrivals if a.on_ramp and a.step >= first]
        if not steps:
            return False
        self._now = steps[0] - 1
        self.loop.run(self._now)
        entered = len(self.loop.ledger)
        self._strategy.agent = -1
        while self._strategy.agent < 0:
            self._now += 1
            self.loop.run(self._now)
            self._strategy.agent = self._first_on_ramp(entered)
        self._started, self._seen = self._now, self._look()
        return True

    def _new_others(self) -> Decider:
        return strategy_to_run(self._others, self._scenario.strategy.get(self._others))

    def _first_on_ramp(self, first: int) -> int:
        """Returns the first row from that one on without a committed merge, -1 for none."""
        ledger = self.loop.ledger
        waiting = (r for r in range(first, len(ledger)) if is_waiting(ledger.merge_time_s(r)))
        return next(waiting, -1)

    def _look(self) -> Seen:
        wanted = -1 if self._everyone else self._strategy.agent
        fleet = self.loop.ledger.fleet
        at_s = self._now * self._step_s
        return Seen(*seen_by_agents(fleet, at_s, wanted, self._slots, self._packed))

    def _observation(self) -> FloatArray:
        features = self._seen.features if self._everyone else self._seen.features[0]
        return np.clip(features, self._observations.low, self._observations.high)

    def _reward(self, rows: list[int], before_m: FloatArray, accel_mps2: FloatArray) -> float:
        road, ledger, reward = self._rules.road, self.loop.ledger, 0.0
        now_s = self._now * self._step_s
        for row, was_m, accel in zip(rows, before_m.tolist(), accel_mps2.tolist(), strict=False):
            is_m, _ = station_and_speed(ledger.way(row), now_s)
            on_ramp_m = min(0.0, is_m) - min(0.0, was_m)
            wished_s = on_ramp_m / road.ramp_speed_mps
            wished_s += (is_m - was_m - on_ramp_m) / road.mainline_speed_mps
            reward += wished_s - self._hold_s - ACTION_WEIGHT * accel * accel * self._hold_s
            if is_m >= 0.0:
                way_m = road.mainline_end_m + self._lag_m - max(0.0, is_m)
                to_come_s = ledger.exit_time_s(row) - now_s
                reward += way_m / road.mainline_speed_mps - to_come_s
        return reward

    def _ended(self) -> bool:
        if len(self._seen.rows):
            return False
        if not self._everyone:
            return True
        entered = set(self.loop.entered()[0].tolist())
        return not any(a.on_ramp for k, a in enumerate(self.arrivals) if k not in entered)

    def _info(self) -> dict[str, Any]:
        return {
            "time_s": self._now * self._step_s,
            "interventions": self._interventions,
            "rows": self._seen.rows.tolist(),
        }


def _check(agents: str, horizon_s: float, slots: int, period_s: float, longest_s: float) -> None:
    """Raises CorampError with a line for each setting that cannot be."""
    wrong = {
        f"agents: {agents!r} cannot be; allowed are one, all": agents not in ("one", "all"),
        f"horizon_s: {horizon_s:g} cannot be; allowed is above {WARM_UP_S:g} s": not (
            WARM_UP_S < horizon_s < math.inf
        ),
        f"slots: {slots} cannot be; allowed is at least 1": slots < 1,
        f"period_s: {period_s:g} cannot be; allowed is above 0, up to {LONGEST_PERIOD_S:g}": not (
            0.0 < period_s <= LONGEST_PERIOD_S
        ),
        f"longest_s: {longest_s:g} cannot be; allowed is period_s, {period_s:g}, and more": not (
            0.0 < longest_s < math.inf and not longest_s < period_s
        ),
    }
    if told := [line for line, is_wrong in wrong.items() if is_wrong]:
        raise CorampError(*told)


def _bounds(rules: Rules, shape: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    fastest_mps = rules.road.mainline_speed_mps * (1.0 + rules.motion.speed_deviation)
    low = [0.0, rules.road.ramp_start_m, 0.0, 0.0, 0.0] + [-FARTHEST_M, 0.0] * (2 * NEIGHBOURS)
    high = [1.0, 0.0, fastest_mps, FARTHEST_M, fastest_mps]
    high += [FARTHEST_M, 2.0 * fastest_mps] * (2 * NEIGHBOURS)
    return (
        np.broadcast_to(np.array(low), shape).copy(),
        np.broadcast_to(np.array(high), shape).copy(),
    )


@kernel
def seen_by_agents(
    fleet: Fleet, at_s: float, wanted: int, slots: int, packed_rules: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Returns the features of ramp vehicles before the nose, front first, and their rows.

    ``wanted`` is the only row that is an agent, -1 makes all of them agents.
    """
    rules = unpacked(packed_rules)
    road = rules.road
    platoon = virtual_platoon(fleet, at_s, packed_rules)
    features = np.zeros((slots, FEATURES))
    rows = np.empty(slots, np.int64)
    n, last_on_ramp = 0, -1
    for k in range(len(platoon.rows)):
        if platoon.stage[k] == MAINLINE:
            continue
        if n < slots and platoon.stage[k] == RAMP and wanted in (-1, platoon.rows[k]):
            rows[n] = platoon.rows[k]
            own = features[n]
            own[0], own[1], own[2] = 1.0, platoon.station_m[k], platoon.speed_mps[k]
            own[3], own[4] = FARTHEST_M, road.ramp_speed_mps
            if last_on_ramp >= 0:
                ahead_m = platoon.station_m[last_on_ramp] - platoon.length_m[last_on_ramp]
                own[3] = ahead_m - platoon.station_m[k]
                own[4] = platoon.speed_mps[last_on_ramp]
            for j in range(2 * NEIGHBOURS):
                other = k - NEIGHBOURS + j + (j >= NEIGHBOURS)
                own[5 + 2 * j] = FARTHEST_M if j < NEIGHBOURS else -FARTHEST_M
                own[6 + 2 * j] = road.mainline_speed_mps
                if 0 <= other < len(platoon.rows):
                    own[5 + 2 * j] = platoon.virtual_m[other] - platoon.virtual_m[k]
                    own[6 + 2 * j] = platoon.virtual_mps[other]
            n += 1
        last_on_ramp = k
    return features, rows[:n]
