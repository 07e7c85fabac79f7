"""Settings that all tests share."""

import subprocess
import sys
import time

import pytest
from distributed import Client
from hypothesis import HealthCheck, settings

from coramp.strategies import registry

settings.register_profile(
    "coramp",
    deadline=None,  # the first call of a kernel compiles it
    derandomize=True,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("coramp")


@pytest.fixture(autouse=True, scope="module")
def _only_our_strategies():
    """What a test registers is gone after its module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "_STRATEGIES", dict(registry.strategies()))
        yield


def _started(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


@pytest.fixture
def dask(tmp_path):
    """A scheduler's address and the processes of its two workers."""
    contact = tmp_path / "scheduler.json"
    processes = [
        _started(
            "dask_scheduler",
            *("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-jupyter"),
            *("--scheduler-file", str(contact)),
        )
    ]
    for _ in range(600):
        if contact.exists():
            break
        time.sleep(0.1)
    processes += [
        _started(
            "dask_worker",
            *("--scheduler-file", str(contact), "--name", name, "--nthreads", "1"),
            *("--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path / name)),
        )
        for name in ("one", "two")
    ]
    with Client(scheduler_file=str(contact)) as client:
        client.wait_for_workers(2, timeout=60)
        address = client.scheduler.address
    yield address, processes[1:]
    for process in processes:
        process.kill()
        process.wait()
