"""What the benchmarks share: plain sumo's own time, and a clock on SUMO sessions."""

import re
import subprocess
import time
from contextlib import contextmanager
from dataclasses import dataclass

from coramp.worlds.sumo import engine
from coramp.worlds.sumo.network import sumo_binary
from coramp.worlds.sumo.session import Session


@dataclass
class Clock:
    seconds: float = 0.0


@contextmanager
def simulation_clock(monkeypatch, module=engine):
    """Times what happens between the start and the close of a module's SUMO sessions."""
    clock = Clock()

    class Timed(Session):
        def __enter__(self):
            self.started = time.perf_counter()
            return super().__enter__()

        def __exit__(self, *reason):
            clock.seconds = time.perf_counter() - self.started
            return super().__exit__(*reason)

    with monkeypatch.context() as patched:
        patched.setattr(module, "Session", Timed)
        yield clock


def plain_sumo_s(folder):
    """Returns the simulation time that sumo itself reports, on kept files, writing nothing."""
    command = (folder / "command.txt").read_text().split()[1:]
    done = subprocess.run(
        [sumo_binary("sumo"), *command, "--duration-log.statistics", "--no-warnings"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    found = re.search(r"Duration: ([0-9.]+)s", done.stdout)
    assert found is not None, done.stdout
    return float(found.group(1))
