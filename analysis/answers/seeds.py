"""Random numbers that depend on what was observed, not on its order or on anybody's name."""

from __future__ import annotations

from hashlib import sha256

import numpy as np

DRAWS = 999
"""Random rearrangements behind a permutation p, which is therefore a multiple of 1/1000."""


def seeded_by(data: bytes, seed: int, occurrence: int = 0) -> np.random.Generator:
    """Return a generator for what was observed.

    `occurrence` tells apart observations that are the same by chance, counted from 0.

    Raises ValueError for a seed that is not a whole number of at least 0.

    >>> seeded_by(b"a", 0).random() == seeded_by(b"a", 0).random()
    True
    >>> seeded_by(b"a", 0).random() == seeded_by(b"a", 0, occurrence=1).random()
    False
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ValueError(f"seed must be a whole number of at least 0, got {seed!r}")
    words = np.frombuffer(sha256(data).digest(), dtype=">u4").astype(int).tolist()
    return np.random.default_rng([seed, occurrence, *words])
