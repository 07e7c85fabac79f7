"""One run in SUMO in which a policy answers for some automated vehicles instead of the strategy."""

import tempfile
import weakref
from contextlib import ExitStack
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.errors import CorampError
from coramp.gym_mixed.lost import Losses
from coramp.gym_mixed.seen import FEATURES, Heard, Stretch, agents_among, features_of
from coramp.metrics.tables import tables_of
from coramp.mixed.situation import MixedStrategy
from coramp.mixed.users import RoadUsers
from coramp.records.schemas import Row
from coramp.scenarios.model import Scenario
from coramp.worlds.sumo.files import SumoOptions
from coramp.worlds.sumo.mixed import Driven, MixedRun, Moment, begun

BEHIND_M = 150.0
"""Who is at most so far behind the only agent counts for its reward."""
CUT_MPS2 = 0.1
"""A vehicle that is driven slower than it was told by more than this was cut."""


class Asked(NamedTuple):
    """What agents ask for, one entry each: their numbers, accelerations (m/s2), wish to merge."""

    number: IntArray
    accel_mps2: FloatArray
    merge: BoolArray


NOTHING = Asked(np.empty(0, np.int64), np.empty(0), np.empty(0, np.bool_))


class Episode:
    """A run that stands still at each decision until it is told to go on.

    ``late`` is the first number that may be the only agent, None if all ramp vehicles are agents.
    ``cut`` counts decisions at which an agent was driven slower than it was told, ``refused`` those
    at which one on the acceleration lane was told to merge and did not. ``lost_s`` and
    ``hard_brakings`` are those of all so far, or of the only agent and those near behind it.
    """

    _open: ClassVar["weakref.ref[Episode] | None"] = None

    def __init__(
        self,
        scenario: Scenario,
        strategy: MixedStrategy,
        population: str,
        seed: int,
        late: int | None,
    ) -> None:
        """Starts SUMO; raises CorampError where another episode of this process still runs."""
        running = None if Episode._open is None else Episode._open()
        if running is not None and not running.ended:
            raise CorampError(
                "MixedMerge-v0: SUMO runs one simulation a process, and the episode of another "
                "environment still runs in this one; close() that, or give each environment a "
                "process of its own (gymnasium.vector.AsyncVectorEnv)"
            )
        self.ended: bool = False
        self.is_cut_off: bool = False
        self.cut, self.refused, self.lost_s, self.hard_brakings = 0, 0, 0.0, 0
        self._scenario, self._late, self.agent = scenario, late, -1
        self._files, self._sumo = ExitStack(), ExitStack()
        folder = self._files.enter_context(tempfile.TemporaryDirectory(prefix="coramp-"))
        self._finalizers = [weakref.finalize(self, s.close) for s in (self._files, self._sumo)]
        session = begun(scenario, strategy, population, seed, SumoOptions(), Path(folder))
        self.run: MixedRun = self._sumo.enter_context(session)
        Episode._open = weakref.ref(self)
        automated = self.run.plant.able.automated
        on_ramp = np.array([a.on_ramp for a in self.run.arrivals], np.bool_)
        self._to_merge = on_ramp & automated
        self.losses = Losses(scenario, self.run.arrivals, automated)
        self._moments = self.run.decisions()
        self.moment: Moment = next(self._moments)
        self._take_in()
        self.lost_s += float(self.losses.lost_s[self._counts()].sum())

    def close(self) -> None:
        """Ends SUMO and removes its files."""
        self.end()
        self._files.close()

    def end(self) -> None:
        """Ends SUMO; what it has written can still be read."""
        if not self.ended:
            self.ended = True
            self._sumo.close()

    @property
    def _is_over(self) -> bool:
        """Whether the only agent has left the road; always False where all are agents."""
        gone = self.agent not in self.moment.users.number
        return self.agent >= 0 and gone and not self._to_merge[self.agent]

    def agents(self, slots: int) -> IntArray:
        """Returns which of those whom the coordinator has heard are agents now, front first."""
        moment = self.moment
        if moment.steering is None:
            return np.empty(0, np.int64)
        if self._late is not None and self.agent < 0:
            new = agents_among(moment.seen, len(moment.seen.number), None)
            new = new[moment.seen.number[new] >= self._late]
            if len(new) == 0:
                return new
            self.agent = int(moment.seen.number[new].min())
        chosen = agents_among(moment.seen, slots, None if self._late is None else self.agent)
        return chosen[self._to_merge[moment.seen.number[chosen]]]

    def features(self, agents: IntArray, slots: int) -> FloatArray:
        """Returns what these agents see, a row each, zeros for slots without one."""
        moment, control, ramp = self.moment, self.run.control, self._scenario.ramp
        if moment.steering is None:
            return np.zeros((slots, FEATURES))
        age_s = control.air.age_s(moment.now_s, moment.seen.number)
        heard = Heard(moment.seen, age_s, moment.steering.places)
        stretch = Stretch(-ramp.start_m, ramp.acceleration_lane_m)
        return features_of(heard, agents, slots, control.laws.road, stretch)

    def go_on(self, asked: Asked) -> None:
        """Carries out a decision and goes on to the next one, or to the end.

        Agents that have merged since they asked are left to the strategy.
        """
        driven = self.run.carry_out(self._with(asked))
        if driven is not None:
            self._count(asked, driven)
        counts, losses = self._counts(), self.losses
        lost_s, hard_brakings = losses.lost_s.copy(), losses.hard_brakings.copy()
        after = next(self._moments, None)
        if after is None:
            self._come_to_the_end()
        else:
            self.moment = after
            self._take_in()
        self.lost_s += float((losses.lost_s - lost_s)[counts].sum())
        self.hard_brakings += int((losses.hard_brakings - hard_brakings)[counts].sum())
        if self._is_over:
            self.end()

    def cut_off(self) -> None:
        """Ends SUMO before its time, if it has not ended."""
        if not self.ended:
            self.is_cut_off = True
            self.end()

    def _with(self, asked: Asked) -> Moment:
        """The moment in which agents ask for what their policy says."""
        moment = self.moment
        if moment.steering is None or len(asked.number) == 0:
            return moment
        entry = {int(number): i for i, number in enumerate(moment.seen.number)}
        most_mps2 = moment.steering.most_mps2.copy()
        may_merge = moment.steering.may_merge.copy()
        for number, accel_mps2, merge in zip(*asked, strict=True):
            i = entry.get(int(number), -1)
            if i >= 0 and self._to_merge[number] and not moment.seen.on_mainline[i]:
                most_mps2[i], may_merge[i] = accel_mps2, merge
        steering = moment.steering._replace(most_mps2=most_mps2, may_merge=may_merge)
        return moment._replace(steering=steering)

    def _count(self, asked: Asked, driven: Driven) -> None:
        """Counts where an agent did not do what it was told."""
        users = self.moment.users
        own = np.isin(users.number, asked.number) & ~users.on_mainline
        told_mps2 = np.where(np.isfinite(driven.told_mps2), driven.told_mps2, -np.inf)
        self.cut += int((own & (driven.accel_mps2 < told_mps2 - CUT_MPS2)).sum())
        self.refused += int((own & driven.wishes & ~driven.changes).sum())

    @property
    def _looked_s(self) -> float:
        """When everybody was where the moment has them: a step before it, as SUMO tells it."""
        return self.moment.now_s - self.run.plant.step_s

    def _take_in(self) -> None:
        users = self.moment.users
        self.losses.look(self._looked_s, users)
        self._to_merge[users.number[users.on_mainline]] = False

    def _come_to_the_end(self) -> None:
        """Nobody is left, or the scenario's end has come: then the run is cut off."""
        plant, users = self.run.plant, self.moment.users
        if plant.session.vehicles_left():
            self.cut_off()
        else:
            nobody = RoadUsers._make(column[:0] for column in users)
            self.losses.look(self._looked_s + plant.period_s, nobody)
            self.end()

    def _counts(self) -> BoolArray:
        """Returns whose losses count now: all, or the only agent and those near behind it."""
        count = len(self.losses.lost_s)
        if self._late is None:
            return np.ones(count, np.bool_)
        near, users = np.zeros(count, np.bool_), self.moment.users
        own = np.flatnonzero(users.number == self.agent)
        if len(own):
            behind_m = users.station_m[own[0]] - users.station_m
            near[users.number[(behind_m >= 0.0) & (behind_m <= BEHIND_M)]] = True
        return near

    def figures(self) -> Row:
        """Returns the run's figures as in ``runs.parquet``, from SUMO's positions up to its end.

        It is to have ended, and not been closed.
        """
        return tables_of(self.run.outcome(self.moment.now_s), self._scenario).metrics
