"""Random streams: each job draws from its own, whatever the order or the number of the jobs."""

import hashlib
from numbers import Integral

import numpy as np

from imuarray.errors import InputError

# The kind comes first, so that the name "3" and the number 3 are different streams.
_NUMBER, _TEXT = 0, 1


def _words(name: str | int) -> tuple[int, int, int]:
    """Three 32-bit words for one part of a stream's name.

    A fixed number of words keeps neighbouring parts apart: ("ab", "c") is not ("a", "bc"). Python's
    own `hash` would not do, it differs from one process to the next.
    """
    if isinstance(name, str):
        value = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
        kind = _TEXT
    elif isinstance(name, Integral) and 0 <= name < 2**64:
        value, kind = int(name), _NUMBER
    else:
        raise InputError(
            f"random stream: expected a name that is text or an integer from 0 to 2**64 - 1, "
            f"found {name!r}"
        )
    return kind, value & 0xFFFFFFFF, value >> 32


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Generator of the stream called `names` under `seed`.

    The same seed and names give the same numbers on every machine; different ones are independent.
    Raises InputError if the seed is not a non-negative integer, or a name is neither text nor an
    integer from 0 to 2**64 - 1.
    """
    if not isinstance(seed, Integral) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"seed: expected a non-negative integer, found {seed!r}")
    key = tuple(word for name in names for word in _words(name))
    sequence = np.random.SeedSequence(int(seed), spawn_key=key)
    return np.random.Generator(np.random.PCG64DXSM(sequence))
