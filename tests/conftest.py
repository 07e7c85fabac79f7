"""Settings that all tests share."""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "coramp",
    deadline=None,  # the first call of a kernel compiles it
    derandomize=True,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("coramp")
