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
