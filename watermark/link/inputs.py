"""Samples and payloads as they come in from outside, checked."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.errors import CueError


class PayloadSizes(Protocol):
    """Sizes of the two parts of a superframe, in bytes."""

    @property
    def l0_bytes(self) -> int:
        """Of the better protected part."""

    @property
    def l1_bytes(self) -> int:
        """Of the other one."""


def checked_payload(
    source: Callable[[int], tuple[bytes, bytes]], k: int, profile: PayloadSizes
) -> tuple[bytes, bytes]:
    """Ask a source for superframe `k` and return its two parts.

    Raises
    ------
    CueError
        If they are not two strings of bytes of the profile's sizes.

    Examples
    --------
    >>> from watermark import PROFILES
    >>> checked_payload(lambda k: bytes(27), 0, PROFILES["audio"]["standard"])
    Traceback (most recent call last):
    codec.errors.CueError: source(0) gave bytes, expected a pair (l0, l1) of 20 and 7 bytes
    """
    given = source(k)
    wanted = profile.l0_bytes, profile.l1_bytes
    found: object = type(given).__name__
    if isinstance(given, tuple) and all(isinstance(part, bytes) for part in given):
        found = tuple(len(part) for part in given)
    if found == wanted:
        return given
    sizes = f"parts of {found} bytes" if isinstance(found, tuple) else found
    raise CueError(
        f"source({k}) gave {sizes}, expected a pair (l0, l1) of {wanted[0]} and {wanted[1]} bytes"
    )


def checked_block(block: ArrayLike, channels: int, kind: type[Any] = np.float64) -> NDArray[Any]:
    """Return a block of samples in a precision.

    Parameters
    ----------
    block : array_like of float, shape (n, channels)
        Full scale 1; any n.
    channels : int
    kind : type
        The precision.

    Raises
    ------
    CueError
        If the samples are integers (whose full scale is not 1), not finite, or of another shape.

    Examples
    --------
    >>> checked_block(np.zeros((2, 1), np.int16), 1)
    Traceback (most recent call last):
    codec.errors.CueError: samples are int16, expected float of full scale 1: divide by 32768
    """
    x = np.asarray(block)
    if x.dtype.kind in "iu":
        scale = 1 << (8 * x.dtype.itemsize - 1)
        raise CueError(f"samples are {x.dtype}, expected float of full scale 1: divide by {scale}")
    if x.dtype.kind != "f":
        raise CueError(f"samples are {x.dtype}, expected float of full scale 1")
    if x.ndim != 2 or x.shape[1] != channels:
        hint = ": add an axis, block[:, None]" if x.ndim == 1 and channels == 1 else ""
        raise CueError(f"block of shape {x.shape}, expected (n, {channels}){hint}")
    y = x.astype(kind)
    if not np.isfinite(y).all():
        raise CueError("samples are not finite: a sum or a division went wrong before")
    return y
