"""Random numbers by what they are for and when: none are drawn in turn, so that no frame hangs on another."""

import zlib

import numpy as np


def keyed_rng(seed: int, purpose: str, time: float | None = None) -> np.random.Generator:
    """A generator of its own for a purpose, or for an instant (s, told apart by the nanosecond) of it."""
    instant = () if time is None else (round(time * 1e9) % 2**64,)
    key = (zlib.crc32(purpose.encode()), *instant)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
