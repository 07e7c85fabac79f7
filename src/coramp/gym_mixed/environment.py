"""MixedMerge-v0: automated ramp vehicles merge among SUMO's drivers.

Once Gymnasium and ``coramp`` are imported, ``gymnasium.make("coramp/MixedMerge-v0")`` makes one.
"""

import math
from collections.abc import Mapping
from typing import Any, cast

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from coramp._kernel import IntArray
from coramp.coordination.guard import strategy_to_run
from coramp.demand.arrivals import arrivals_of, automated_of
from coramp.errors import CorampError
from coramp.gym_mixed.episode import NOTHING, Asked, Episode
from coramp.gym_mixed.seen import FEATURES
from coramp.mixed.laws import FollowingLaw
from coramp.mixed.situation import MixedStrategy
from coramp.records.schemas import Row
from coramp.runs.mixed import coordinates_drivers
from coramp.runs.running import make_spec
from coramp.strategies.registry import strategies, strategy_named

Floats32 = npt.NDArray[np.float32]

SHARE = "traffic.automated_share"
WARM_UP_S = 30.0
"""The only agent is drawn from those scheduled later than this."""
FIRST_DRAWN, LAST_DRAWN = 1_000_000, 2**31 - 1
"""Seeds of traffic that a reset without a seed draws from: smaller ones stay unseen."""
MOST_DRAWS = 1000
"""So often traffic is drawn anew for an episode before there is taken to be no agent at all."""
LONGEST_PERIOD_S, ROUNDING_S = 10.0, 1e-6


class MixedMerge(gymnasium.Env[Floats32, Floats32]):
    """Merging among drivers in SUMO; a step is ``period_s``, or longer while nobody is an agent.

    **Agents.** ``agents="all"``: every automated ramp vehicle that has not merged, the foremost
    ``slots`` at a time, front first. ``agents="one"``: one ramp vehicle, drawn from those scheduled
    after 30 s. The strategy ``others`` tells all other automated vehicles what to do, and agents
    once they have merged. It leaves room for agents too. A vehicle is an agent as long as the
    coordinator knows where it is.

    **Action**, shape (2,) or (slots, 2), from -1 to 1: the most that the vehicle is to speed up, as
    a share of ``motion.comfort_mps2`` below 0 and of 2.5 m/s2 above; and whether it is to merge
    (from 0 on) or to pass a gap up. It takes the place of the strategy's answer: it goes over the
    same link, is renewed at each decision of the strategy, and the vehicle keeps its distances, its
    speed limit, and a way to stop before the lane's end, whatever it is told. ``step(None)`` leaves
    agents to the strategy.

    **Observation**, shape (26,) or (slots, 26), from -1 to 1, of what the coordinator has heard: 1
    if there is an agent; its station (-1 at the ramp's start, 0 at the nose, 1 at the end of the
    acceleration lane); its speed and that of the lane beside it (v0); the age of its last report
    (1 s); ramp vehicles behind it (10). Then four numbers each of five vehicles: free distance
    (100 m; negative behind), speed beyond the agent's (10 m/s), 1 for an automated vehicle or -1
    for a driver, age of the last report (1 s). The five are the one ahead on the ramp, and in the
    order in which vehicles are to pass the two before the agent, the further one first, and the two
    after it. There the distance is that of virtual stations (``mixed.sequence``). In brackets: what
    counts as 1. All is cut off there. Who is not there is 1 or -1 away, and 0 in all else.

    **Reward** of a step, ``agents="all"``: minus the time (s) that all vehicles have lost in it
    against free movement, waiting outside included, minus ``braking_cost_s`` for each time that a
    driver began to brake harder than 3 m/s2; over the number of vehicles. So an episode's sum is
    minus the mean delay of a run, minus the cost of drivers' hard braking a vehicle. With
    ``agents="one"`` the agent counts and who is up to 150 m behind it, on any lane, not divided.
    So an episode's sum is minus what these lose while it is on the road as an agent and afterwards.

    **End.** Terminated when no agent is left and, by the strategy, all vehicles (the agent) have
    left the road, which belongs to the last step. Truncated ``longest_s`` after the first
    observation, or at the scenario's end. ``reset(seed=n)`` gives the arrivals, drivers and faults
    of ``coramp run --seed n``; without a seed traffic is drawn from seeds above a million. ``info``
    has ``time_s``; ``vehicles``, the names of the agents; ``cut`` and ``refused``, at how many
    decisions so far an agent was driven slower than it was told, or not let into the lane that it
    was told to merge into; ``fallbacks`` as in ``runs.parquet``; ``hard_brakings`` of drivers and
    ``lost_s``, both of those who count for the reward. ``figures()`` has more after the end.

    SUMO runs one simulation a process: one episode at a time, until its end or ``close()``.
    """

    metadata = {"render_modes": []}  # noqa: RUF012 - Gymnasium's own attribute

    def __init__(
        self,
        scenario: str = "paper",
        agents: str = "all",
        *,
        mainline_veh_h: float | None = 1800.0,
        ramp_veh_h: float | None = 500.0,
        automated_share: float | None = 0.5,
        drivers: str | None = None,
        overrides: Mapping[str, Any] | None = None,
        horizon_s: float | None = 120.0,
        period_s: float = 1.0,
        slots: int = 4,
        others: str = "mixed-slots",
        braking_cost_s: float = 1.0,
        longest_s: float = 600.0,
    ) -> None:
        """Raises CorampError for a scenario, strategy or number that cannot be.

        ``overrides`` are dotted keys of the scenario, such as ``world.preset`` or ``reports.loss``.
        Flows, share and horizon are the scenario's own where they are None.
        """
        _check(agents, slots, period_s, braking_cost_s, longest_s)
        share = {} if automated_share is None else {SHARE: float(automated_share)}
        spec = make_spec(
            scenario,
            _coordinating(others),
            mainline_veh_h=mainline_veh_h,
            ramp_veh_h=ramp_veh_h,
            drivers=drivers,
            overrides={**share, **(overrides or {})},
            horizon_s=horizon_s,
            blamed="MixedMerge-v0",
        )
        self._scenario = spec.scenario
        self._population = spec.drivers or drivers or self._scenario.traffic.drivers
        answer = strategy_to_run(others, self._scenario.strategy.get(others))
        self._strategy = cast("MixedStrategy", answer)
        self._decisions = _decisions_of(period_s, self._strategy.decision_s)
        self._everyone, self._slots = agents == "all", slots if agents == "all" else 1
        self._braking_cost_s, self._longest_s = braking_cost_s, longest_s
        motion = self._scenario.motion
        self._brake_mps2, self._speed_up_mps2 = motion.comfort_mps2, FollowingLaw().speed_up_mps2
        self._episode: Episode | None = None
        self._agents, self._since_s, self._paid_s = NOTHING.number, math.inf, 0.0
        row = (self._slots,) if self._everyone else ()
        self.action_space = spaces.Box(-1.0, 1.0, (*row, 2), np.float32)
        self.observation_space = spaces.Box(-1.0, 1.0, (*row, FEATURES), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Returns the first observation: somebody is an agent."""
        super().reset(seed=seed, options=options)
        self.close()
        traffic = self._drawn() if seed is None else seed
        for _ in range(MOST_DRAWS):
            if self._begin(traffic):
                return self._observation(), self._info()
            traffic = self._drawn()
        raise CorampError(
            f"MixedMerge-v0: no automated ramp vehicle came in {MOST_DRAWS} draws of "
            f"{self._scenario.simulation.horizon_s:g} s; allowed are flows, horizons and shares "
            "with somebody automated on the ramp"
        )

    def step(self, action: Floats32 | None) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        """Drives for a period, and on until somebody is an agent or the episode has ended."""
        episode = self._episode
        if episode is None or episode.ended:
            raise CorampError("step: no episode runs; call reset() first")
        asked = self._asked(action)
        try:
            for _ in range(self._decisions):
                self._go_on(episode, asked)
            while not episode.ended and len(self._agents) == 0:
                self._go_on(episode, NOTHING)
        except CorampError:
            self.close()
            raise
        before_s, self._paid_s = self._paid_s, self._cost_s(episode)
        reward = before_s - self._paid_s
        cut_off = episode.is_cut_off
        return self._observation(), reward, episode.ended and not cut_off, cut_off, self._info()

    def close(self) -> None:
        """Ends SUMO; another environment of this process may be reset then."""
        if self._episode is not None:
            self._episode.close()
        self._episode = None

    def figures(self) -> Row:
        """Returns the figures of the episode that has ended, as in ``runs.parquet``.

        They come from SUMO's positions, as those of ``coramp run`` do, collisions by cause and
        broken promises among them. With ``agents="one"`` they end with the episode.
        """
        if self._episode is None or not self._episode.ended:
            raise CorampError("figures: there are none before an episode has ended")
        return self._episode.figures()

    def _drawn(self) -> int:
        return int(self.np_random.integers(FIRST_DRAWN, LAST_DRAWN))

    def _begin(self, traffic: int) -> bool:
        """Starts on new traffic and drives on to the first agent; False where none comes."""
        self.close()
        arrivals = arrivals_of(self._scenario, traffic)
        automated = automated_of(self._scenario, arrivals, traffic)
        first_s = 0.0 if self._everyone else WARM_UP_S
        first = first_s / self._scenario.control.step_s
        own = [k for k, a in enumerate(arrivals) if a.on_ramp and automated[k] and a.step >= first]
        if not own:
            return False
        late = None if self._everyone else own[int(self.np_random.integers(len(own)))]
        episode = Episode(self._scenario, self._strategy, self._population, traffic, late)
        self._episode, self._agents = episode, episode.agents(self._slots)
        self._since_s, self._paid_s = math.inf, 0.0
        while not episode.ended and len(self._agents) == 0:
            self._go_on(episode, NOTHING)
        self._since_s = episode.moment.now_s
        return not episode.ended

    def _go_on(self, episode: Episode, asked: Asked) -> None:
        """Goes on to the next decision, if there is one, and looks who is an agent then."""
        if episode.ended:
            return
        episode.go_on(asked)
        self._agents = episode.agents(self._slots)
        if episode.moment.now_s - self._since_s >= self._longest_s - ROUNDING_S:
            episode.cut_off()

    def _asked(self, action: Floats32 | None) -> Asked:
        """What the agents ask for; nothing where they are left to the strategy."""
        if action is None:
            return NOTHING
        shares = np.asarray(action, np.float64).reshape(-1, 2)
        if not np.isfinite(shares).all():
            raise CorampError("action: holds a number that is not finite")
        if len(shares) != self._slots:
            raise CorampError(
                f"action: {len(shares)} pairs cannot be; allowed are {self._slots}, one a slot"
            )
        shares = np.clip(shares[: len(self._agents)], -1.0, 1.0)
        most_mps2 = np.where(shares[:, 0] < 0.0, self._brake_mps2, self._speed_up_mps2)
        return Asked(self._numbers(), shares[:, 0] * most_mps2, shares[:, 1] >= 0.0)

    def _numbers(self) -> IntArray:
        """The agents' numbers among the arrivals."""
        return self._episode.moment.seen.number[self._agents] if self._episode else NOTHING.number

    def _cost_s(self, episode: Episode) -> float:
        """What has been lost so far: a vehicle where all count, else in sum."""
        cost_s = episode.lost_s + self._braking_cost_s * episode.hard_brakings
        return cost_s / len(episode.run.arrivals) if self._everyone else cost_s

    def _observation(self) -> Floats32:
        if self._episode is None or self._episode.ended:
            features = np.zeros((self._slots, FEATURES))
        else:
            features = self._episode.features(self._agents, self._slots)
        return (features if self._everyone else features[0]).astype(np.float32)

    def _info(self) -> dict[str, Any]:
        episode = self._episode
        if episode is None:
            return {}
        names = [episode.run.arrivals[k].vehicle_id for k in self._numbers().tolist()]
        return {
            "time_s": episode.moment.now_s,
            "vehicles": [] if episode.ended else names,
            "cut": episode.cut,
            "refused": episode.refused,
            "fallbacks": episode.run.control.air.fallbacks,
            "hard_brakings": episode.hard_brakings,
            "lost_s": episode.lost_s,
        }


def _coordinating(others: str) -> str:
    """Returns the name of a strategy; raises CorampError if it cannot coordinate among drivers."""
    if not coordinates_drivers(strategy_named(others)):
        able = ", ".join(name for name, kind in strategies().items() if coordinates_drivers(kind))
        raise CorampError(f"others: {others} coordinates nobody among drivers; allowed is {able}")
    return others


def _decisions_of(period_s: float, decision_s: float) -> int:
    """Returns how many decisions a step has; raises CorampError if that is no whole number."""
    decisions = round(period_s / decision_s)
    if decisions < 1 or abs(decisions * decision_s - period_s) > ROUNDING_S:
        raise CorampError(
            f"period_s: {period_s:g} cannot be; allowed are whole multiples of {decision_s:g}, the "
            f"time between two decisions, up to {LONGEST_PERIOD_S:g}"
        )
    return decisions


def _check(
    agents: str, slots: int, period_s: float, braking_cost_s: float, longest_s: float
) -> None:
    """Raises CorampError with a line for each setting that cannot be."""
    wrong = {
        f"agents: {agents!r} cannot be; allowed are one, all": agents not in ("one", "all"),
        f"slots: {slots} cannot be; allowed is at least 1": slots < 1,
        f"period_s: {period_s:g} cannot be; allowed is above 0, up to {LONGEST_PERIOD_S:g}": not (
            0.0 < period_s <= LONGEST_PERIOD_S
        ),
        f"braking_cost_s: {braking_cost_s:g} cannot be; allowed is 0 and more": not (
            0.0 <= braking_cost_s < math.inf
        ),
        f"longest_s: {longest_s:g} cannot be; allowed is period_s, {period_s:g}, and more": not (
            0.0 < longest_s < math.inf and not longest_s < period_s
        ),
    }
    if told := [line for line, is_wrong in wrong.items() if is_wrong]:
        raise CorampError(*told)
