"""Payloads for the tests of all carriers."""

from collections.abc import Callable

import numpy as np


def payloads(l0_bytes: int, l1_bytes: int) -> Callable[[int], tuple[bytes, bytes]]:
    """A source of pseudorandom superframes of these sizes."""

    def give(k: int) -> tuple[bytes, bytes]:
        rng = np.random.default_rng(k)
        return rng.bytes(l0_bytes), rng.bytes(l1_bytes)

    return give
