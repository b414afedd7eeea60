"""Noise that depends on its seed, the connection's name and the number of the communication step, and on nothing else.

Values come from a counter-based generator in blocks: a step's value is the same whichever steps were asked for before,
however many other noises there are, and in whatever order or thread they are computed."""

import hashlib

import numpy as np
from numpy.typing import NDArray

_BLOCK = 1024  # values of one setting of the counter


def key_of_noise(seed: int, name: str) -> int:
    """128 bits from a seed and the name of a connection."""
    return int.from_bytes(hashlib.sha256(f"{seed}\0{name}".encode()).digest()[:16], "little")


def white(key: int, first: int, count: int) -> NDArray[np.float64]:
    """Values of standard deviation 1 for ``count`` communication steps from ``first`` on, shape (count,)."""
    blocks = range(first // _BLOCK, (first + count - 1) // _BLOCK + 1) if count else range(0)
    values = [
        np.random.Generator(np.random.Philox(key=key, counter=[0, b, 0, 0])).standard_normal(_BLOCK) for b in blocks
    ]
    start = first % _BLOCK
    whole = np.concatenate(values) if values else np.zeros(0)
    return whole[start : start + count]
