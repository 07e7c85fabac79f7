"""The coordinators of a corridor's sites: each knows its zone alone, and answers what it is told.

They run in this process, or in processes of their own; the figures are the same bit for bit.
"""

import multiprocessing
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple, Protocol, cast

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.coordination.guard import strategy_to_run
from coramp.errors import CorampError
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import Ahead
from coramp.mixed.situation import MixedStrategy
from coramp.mixed.users import RoadUsers
from coramp.scenarios.model import Scenario
from coramp.worlds.faults.air import Air
from coramp.worlds.sumo.mixed_lanes import LanedControl

ENDS_WITHIN_S = 10.0
"""So long a process has to end by itself."""


class SiteSetup(NamedTuple):
    """What a site's coordinator is made of; arrays have one entry a vehicle of the whole corridor.

    A command acts ``acts_after_s`` on average after it was given. ``seed`` is that of the links,
    ``vehicles_seed`` that of vehicles' clocks and manners, which are the same at all sites.
    """

    scenario: Scenario
    strategy: str
    laws: OnBoardLaws
    automated: BoolArray
    reporting: BoolArray
    acts_after_s: float
    seed: int
    vehicles_seed: int


class SiteView(NamedTuple):
    """What a site's coordinator is told at ``now_s``: who is in its zone, and who is just ahead.

    ``lane``, ``beside`` and ``tail`` are as in ``LanedPlant``. ``able`` is who is on the
    acceleration lane and can leave it. ``ahead`` is where each will be when a command begins to
    act.
    """

    now_s: float
    users: RoadUsers
    lane: IntArray
    beside: BoolArray
    able: BoolArray
    ahead: Ahead
    tail: BoolArray


class SiteAnswer(NamedTuple):
    """What a site's coordinator answers, one entry a user.

    How each accelerates, who changes lanes, and who asks drivers to make room.
    """

    accel_mps2: FloatArray
    changes: BoolArray
    asks: BoolArray

    @classmethod
    def nothing(cls, count: int) -> "SiteAnswer":
        """Returns the answer to a view without automated vehicles."""
        nobody = np.zeros(count, np.bool_)
        return cls(np.zeros(count), nobody, nobody)


@dataclass
class _Shown:
    """The view of the moment, as a control asks for it."""

    period_s: float
    lane: IntArray
    beside: BoolArray
    tail: BoolArray
    now: Ahead

    def ahead(self, _users: RoadUsers) -> Ahead:
        """Returns where vehicles will be when a new command begins to act."""
        return self.now


class SiteCoordinator:
    """One site's coordinator: it knows what it is told, and what it was told before."""

    def __init__(self, setup: SiteSetup) -> None:
        name = setup.strategy
        strategy = strategy_to_run(name, setup.scenario.strategy.get(name))
        nowhere = np.empty(0, np.bool_)
        nobody = Ahead(np.empty(0), np.empty(0), 0.0)
        self._shown = _Shown(setup.laws.period_s, np.empty(0, np.int64), nowhere, nowhere, nobody)
        self._air = Air(
            setup.scenario,
            setup.reporting,
            setup.automated,
            setup.seed,
            vehicles_seed=setup.vehicles_seed,
        )
        self._control = LanedControl(
            cast("MixedStrategy", strategy),
            setup.laws,
            self._air,
            setup.acts_after_s,
            plant=self._shown,
        )

    def handle(self, view: SiteView) -> SiteAnswer:
        """Returns what those of whom the coordinator is told are to do until the next time."""
        users = view.users
        if not users.automated.any():
            return SiteAnswer.nothing(len(users.number))
        shown = self._shown
        shown.lane, shown.beside, shown.tail = view.lane, view.beside, view.tail
        shown.now = view.ahead
        moment = self._control.decided(view.now_s, [], view.able, users)
        driven = self._control.driven(moment, shown)
        return SiteAnswer(driven.accel_mps2, driven.changes, driven.asks)

    @property
    def counts(self) -> dict[str, int]:
        """How many messages there were, how many were lost, how often vehicles went alone."""
        return self._air.counts


class Sites(Protocol):
    """The coordinators of all sites, wherever they run."""

    def handle(self, views: Sequence[SiteView]) -> list[SiteAnswer]:
        """Returns each site's answer to its view."""
        ...

    def counts(self) -> list[dict[str, int]]:
        """Returns how many messages each site had, and what became of them."""
        ...


class SitesHere:
    """Coordinators in this process."""

    def __init__(self, setups: Sequence[SiteSetup]) -> None:
        self._sites = [SiteCoordinator(setup) for setup in setups]

    def handle(self, views: Sequence[SiteView]) -> list[SiteAnswer]:
        """Returns each site's answer to its view."""
        return [site.handle(view) for site, view in zip(self._sites, views, strict=True)]

    def counts(self) -> list[dict[str, int]]:
        """Returns how many messages each site had, and what became of them."""
        return [site.counts for site in self._sites]


class SitesApart:
    """Coordinators in processes of their own; site k is in the k-th of them, and round again."""

    def __init__(self, lines: Sequence[Connection], sites: int) -> None:
        self._lines = lines
        self._sites = sites

    def handle(self, views: Sequence[SiteView]) -> list[SiteAnswer]:
        """Returns each site's answer to its view."""
        return self._asked([views[k :: len(self._lines)] for k in range(len(self._lines))])

    def counts(self) -> list[dict[str, int]]:
        """Returns how many messages each site had, and what became of them."""
        return self._asked([None] * len(self._lines))

    def _asked(self, questions: Sequence[Any]) -> list[Any]:
        """All processes work at once; answers come in the order of sites."""
        answers: list[Any] = [None] * self._sites
        try:
            for line, question in zip(self._lines, questions, strict=True):
                line.send(question)
            for k, line in enumerate(self._lines):
                answer = line.recv()
                if isinstance(answer, str):
                    raise CorampError(answer)
                answers[k :: len(self._lines)] = answer
        except (EOFError, OSError) as error:
            raise CorampError(
                "--processes: a coordinator's process has ended; run again, or with --processes 1"
            ) from error
        return answers


@contextmanager
def sites_running(setups: Sequence[SiteSetup], processes: int) -> Iterator[Sites]:
    """Gives the coordinators of sites: here, or in so many processes; these end with the run."""
    if processes == 1:
        yield SitesHere(setups)
        return
    context = multiprocessing.get_context("spawn")
    lines: list[Connection] = []
    workers: list[BaseProcess] = []
    try:
        for k in range(min(processes, len(setups))):
            ours, theirs = context.Pipe()
            worker = context.Process(
                target=_serve, args=(theirs, list(setups[k::processes])), daemon=True
            )
            worker.start()
            theirs.close()
            lines.append(ours)
            workers.append(worker)
        yield SitesApart(lines, len(setups))
    finally:
        for line in lines:
            line.close()
        for started in workers:
            started.join(ENDS_WITHIN_S)
            if started.is_alive():
                started.terminate()
                started.join()


def _serve(line: Connection, setups: Sequence[SiteSetup]) -> None:
    """Answers views until the other side closes; a failure is answered in one line."""
    sites = SitesHere(setups)
    while True:
        try:
            question = line.recv()
        except (EOFError, OSError, KeyboardInterrupt):
            return
        try:
            line.send(sites.counts() if question is None else sites.handle(question))
        except CorampError as error:
            line.send(str(error))
        except Exception as error:  # noqa: BLE001 - whatever it is, the run must tell it and end
            line.send(f"a coordinator's process failed: {type(error).__name__}: {error}")
