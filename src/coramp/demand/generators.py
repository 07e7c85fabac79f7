"""Random numbers of a run: each purpose has its own."""

import zlib

import numpy as np


def generator(seed: int, purpose: str) -> np.random.Generator:
    """Returns the random generator of one purpose; another purpose never shifts it."""
    return np.random.default_rng(
        np.random.SeedSequence(seed, spawn_key=(zlib.crc32(purpose.encode()),))
    )
