"""Tells Gymnasium of coramp's environment, without importing what that needs."""

import sys
from typing import Any

ENVIRONMENT = "coramp/Merge-v0"


def register() -> None:
    """Registers the environment where Gymnasium is imported already and does not know it."""
    gymnasium: Any = sys.modules.get("gymnasium")
    if gymnasium is not None and ENVIRONMENT not in gymnasium.registry:
        gymnasium.register(id=ENVIRONMENT, entry_point="coramp.gym:MergeEnv")
