"""Writes MIMU packets: the byte format once more, slowly and on its own."""

import struct

import numpy as np

PERIOD = 1_024_000  # ticks of 64 MHz at 62.5 Hz


def packet(number, ticks, readings) -> bytes:
    """One packet of (K, 6) int16 readings."""
    body = struct.pack(">BHBI", 0xAA, number % 65536, 4 + 12 * len(readings), ticks % 2**32)
    body += b"".join(struct.pack(">6h", *row) for row in readings.tolist())
    return body + struct.pack(">H", sum(body) % 65536)


def acknowledgement(code) -> bytes:
    """A0, the command's code and their sum."""
    return bytes([0xA0, code]) + struct.pack(">H", 0xA0 + code)


def readings(rng, samples, imus) -> np.ndarray:
    """Random counts (T, K, 6), the rails among them."""
    return rng.integers(-32768, 32768, (samples, imus, 6)).astype(np.int16)


def packets(counts, number=0, ticks=0, jitter=None) -> list[bytes]:
    """Packets one period apart, ``jitter`` (T,) ticks off."""
    off = np.zeros(len(counts), int) if jitter is None else jitter
    return [
        packet(number + i, ticks + i * PERIOD + int(off[i]), rows) for i, rows in enumerate(counts)
    ]
