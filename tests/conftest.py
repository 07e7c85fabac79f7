"""Settings that all tests share."""

import pytest
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


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Runs each module on one worker, and each page of the docs as if it were a module.

    Pages take longest, so they come first: what is left at the end is short.
    """
    for item in items:
        group = item.name if runs_a_page(item) else item.nodeid.split("::")[0]
        item.add_marker(pytest.mark.xdist_group(group))
    items.sort(key=lambda item: not runs_a_page(item))


def runs_a_page(item):
    """Returns whether a test runs a page of the docs."""
    return item.name.startswith("test_page_runs[")
