"""Settings that all tests share."""

import gc
import subprocess
import sys
import time

import pytest
from hypothesis import HealthCheck, settings
from xdist.scheduler import LoadFileScheduling

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


class ByModule(LoadFileScheduling):
    """Runs each module on one worker, and each page of the docs as if it were a module."""

    def _split_scope(self, nodeid):
        return nodeid if runs_a_page(nodeid) else super()._split_scope(nodeid)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Returns who spreads tests over the workers."""
    return ByModule(config, log)


def pytest_collection_modifyitems(items):
    """Puts pages first: they take longest, and what is left at the end is short."""
    items.sort(key=lambda item: not runs_a_page(item.nodeid))


def pytest_collection_finish():
    """Has Python look seldom for what is no longer needed: what is imported by now stays."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000)


def runs_a_page(nodeid):
    """Returns whether a test runs a page of the docs."""
    return "::test_page_runs[" in nodeid


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
    from distributed import Client  # takes a second, and few tests need it

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
