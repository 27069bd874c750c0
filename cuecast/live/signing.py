"""Whose cues a running programme carries: each run of its sound signed for when it is on air."""

import time

from codec.authentication.announcement import load_signing_key
from cuecast.dubbing.signing import Signing
from watermark.link.superframe import SUPERFRAME_S

_KEPT = 64
"""Superframes with a remembered proof."""


class LiveSigning:
    """Signs one run of sound after the other.

    Parameters
    ----------
    secret : str
        File of the broadcaster's secret key.
    on_air_s : float or None
        Time of the motion's zero, seconds since 1970 (UTC); None: a superframe signed now is on
        air after the delay.
    delay_s : float
        From in to out.

    Raises
    ------
    CueError
        If the file is no secret key.
    """

    def __init__(self, secret: str, on_air_s: float | None, delay_s: float) -> None:
        self._key = load_signing_key(secret)
        self._on_air_s, self._delay_s = on_air_s, delay_s
        self._last: Signing | None = None

    def run(self, start_s: float, first: int) -> Signing:
        """Return what signs a run that begins at a time of the motion's clock.

        `first` is the number of its first superframe.
        """
        begins_s = time.time() + self._delay_s
        if self._on_air_s is not None:
            begins_s = self._on_air_s + start_s
        self._last = Signing(
            self._key,
            begins_s - first * SUPERFRAME_S,
            kept=_KEPT,
            after=None if self._last is None else self._last.signer,
        )
        return self._last
