"""Runs in SUMO in processes of their own: they tell how far they are, and can be killed.

libsumo has one simulation a process, and cannot be stopped from another thread.
"""

import json
import math
import shutil
import signal
import tempfile
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from threading import BoundedSemaphore, Lock
from typing import NamedTuple

from coramp.errors import CorampError
from coramp.records.run import RunRecords
from coramp.report.page.shown import page_data
from coramp.runs.running import RunSpec, recorded
from coramp.worlds.sumo.files import SumoOptions

Played = tuple[RunRecords, str]
"""A run, and what the page's scripts take for it."""
MOST = 2
"""So many processes run at once: a page asks for two runs."""
LOOK_S = 0.05
"""How often it is looked whether a run is still wanted."""
TELL_S = 0.1
"""At most so often a process tells how far it is."""


class UnwantedError(CorampError):
    """Nobody waits for a run any more."""

    def __init__(self) -> None:
        super().__init__("run: it was given up, since nobody waited for it any more")


class Simulated(NamedTuple):
    """So much of a run is simulated; infinity once its figures are worked out."""

    time_s: float


class Failed(NamedTuple):
    """A run failed, for these reasons."""

    messages: tuple[str, ...]


def played_from(run: RunRecords) -> Played:
    """Returns a run with what the page's scripts take for it."""
    return run, json.dumps(page_data(run), separators=(",", ":"), allow_nan=False)


class SumoProcess:
    """A process that makes one run in SUMO after the other."""

    def __init__(self) -> None:
        # What a process that is killed leaves behind lies in a folder that is then removed.
        folder = tempfile.mkdtemp(prefix="coramp-studio-")
        self._remove_folder = weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        spawned = get_context("spawn")
        self._pipe, theirs = spawned.Pipe()
        self._process = spawned.Process(target=_make_runs, args=(theirs, folder), daemon=True)
        self._process.start()
        theirs.close()

    @property
    def pid(self) -> int | None:
        """Its number in the system."""
        return self._process.pid

    def run(
        self, spec: RunSpec, tell: Callable[[Simulated], None], wanted: Callable[[], bool]
    ) -> Played | Failed:
        """Returns a run, or why it failed.

        Raises UnwantedError as soon as it is not wanted, and CorampError if the process ends. After
        either, the process must be killed.
        """
        try:
            self._pipe.send(spec)
            while True:
                while not self._pipe.poll(LOOK_S):
                    if not wanted():
                        raise UnwantedError
                told = self._pipe.recv()
                if not isinstance(told, Simulated):
                    return told  # type: ignore[no-any-return]
                tell(told)
        except (EOFError, OSError):
            self._process.join(1.0)
            raise CorampError(
                f"SUMO: its process ended with code {self._process.exitcode} before the run did; "
                "move any dial to try again"
            ) from None

    def kill(self) -> None:
        """Ends the process at once, whatever it does, and removes what it wrote."""
        self._process.kill()
        self._process.join()
        self._pipe.close()
        self._remove_folder()


def _make_runs(pipe: Connection, folder: str) -> None:
    """What the process does: it makes the runs that it is sent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # ctrl-c is for the server, which ends this
    tempfile.tempdir = folder
    with suppress(EOFError, OSError):  # the server has ended
        while True:
            pipe.send(_made(pipe.recv(), pipe))
    shutil.rmtree(folder, ignore_errors=True)


def _made(spec: RunSpec, pipe: Connection) -> Played | Failed:
    last_s = -TELL_S

    def tell(time_s: float) -> None:
        nonlocal last_s
        if time_s == math.inf or time.monotonic() - last_s >= TELL_S:
            last_s = time.monotonic()
            pipe.send(Simulated(time_s))

    try:
        return played_from(recorded(spec, SumoOptions(tell=tell)))
    except CorampError as error:
        return Failed(error.messages)
    except Exception as error:  # noqa: BLE001 - whatever it is, the page is to say it
        return Failed((f"{type(error).__name__}: {error}",))


@dataclass
class SumoProcesses:
    """Processes that wait for runs; one that is killed is replaced at once, so that it is ready."""

    _free: BoundedSemaphore = field(default_factory=lambda: BoundedSemaphore(MOST))
    _lock: Lock = field(default_factory=Lock)
    _idle: list[SumoProcess] = field(default_factory=list)
    _closed: bool = False

    def run(
        self, spec: RunSpec, tell: Callable[[Simulated], None], wanted: Callable[[], bool]
    ) -> Played:
        """Returns a run; ``tell`` is told how far it is.

        Raises UnwantedError, after the process was killed, once the run is not wanted. Raises
        CorampError where the run fails.
        """
        while not self._free.acquire(timeout=LOOK_S):
            if not wanted():
                raise UnwantedError
        try:
            process = self._taken()
            try:
                found = process.run(spec, tell, lambda: wanted() and not self._closed)
            except BaseException:
                process.kill()
                process = SumoProcess()
                raise
            finally:
                self._give_back(process)
        finally:
            self._free.release()
        if isinstance(found, Failed):
            raise CorampError(*found.messages)
        return found

    def get_ready(self) -> None:
        """Starts processes, so that runs need not wait for that."""
        taken = 0
        while taken < MOST and self._free.acquire(blocking=False):
            taken += 1
        processes = [self._taken() for _ in range(taken)]
        for process in processes:
            self._give_back(process)
            self._free.release()

    def close(self) -> None:
        """Ends all processes."""
        with self._lock:
            self._closed = True
            idle, self._idle = self._idle, []
        for process in idle:
            process.kill()

    def _taken(self) -> SumoProcess:
        with self._lock:
            if self._idle:
                return self._idle.pop()
        return SumoProcess()

    def _give_back(self, process: SumoProcess) -> None:
        with self._lock:
            if not self._closed:
                self._idle.append(process)
                return
        process.kill()
