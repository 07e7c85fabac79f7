"""coramp: cooperative on-ramp merging, planned, proved safe, driven in SUMO, compared.

>>> import coramp
>>> plan = coramp.plan("example")
>>> plan.decisions["front_vehicle_id"].item()
'm4'
"""

from typing import TYPE_CHECKING, Any

from coramp import _registration
from coramp.errors import CorampError

if TYPE_CHECKING:
    from coramp.api import (
        CorridorResult,
        CorridorStudyResult,
        PlanResult,
        RunResult,
        StudyResult,
        corridor,
        figures,
        load,
        plan,
        register,
        run,
        study,
    )

__all__ = [
    "CorampError",
    "CorridorResult",
    "CorridorStudyResult",
    "PlanResult",
    "RunResult",
    "StudyResult",
    "corridor",
    "figures",
    "load",
    "plan",
    "register",
    "run",
    "study",
]

_registration.register()


def __getattr__(name: str) -> Any:
    """Imports the API at its first use, so that ``import coramp`` and ``--help`` stay quick."""
    if name in __all__:
        from coramp import api

        return getattr(api, name)
    if name == "__version__":
        from importlib import metadata

        return metadata.version("coramp")
    raise AttributeError(f"module 'coramp' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Returns what the module offers, the API too, so that completion finds it."""
    return sorted({*(name for name in globals() if name.startswith("__")), *__all__, "__version__"})
