"""Tells Gymnasium of coramp's environments, without importing what they need."""

import sys
from typing import Any

ENVIRONMENTS = {
    "coramp/Merge-v0": "coramp.gym:MergeEnv",
    "coramp/Merge-v1": "coramp.gym_v1:MergeSlots",
    "coramp/MixedMerge-v0": "coramp.gym_mixed.environment:MixedMerge",
}


def register() -> None:
    """Registers the environments where Gymnasium is imported already and does not know them."""
    gymnasium: Any = sys.modules.get("gymnasium")
    if gymnasium is None:
        return
    for name, entry_point in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(id=name, entry_point=entry_point)
