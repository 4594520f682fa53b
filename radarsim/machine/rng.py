"""Random generators keyed by purpose and time, so that no frame depends on the order of others."""

import zlib

import numpy as np


def keyed_rng(seed: int, purpose: str, time: float | None = None) -> np.random.Generator:
    """Return the random generator of a purpose, or of a time (s, to the nanosecond) within it."""
    instant = () if time is None else (round(time * 1e9) % 2**64,)
    key = (zlib.crc32(purpose.encode()), *instant)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
