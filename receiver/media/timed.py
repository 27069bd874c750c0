"""Packets of a line's picture, each placed on a clock of our own, become frames on that clock."""

from collections.abc import Iterator
from typing import Any

import av

_MOST_TIMES = 256
"""Times of packets that wait for their frames at most."""


class TimedDecoder:
    """Decoder of one picture stream whose packets are due at times that the caller knows.

    Parameters
    ----------
    context : av codec context
        Announces the codec.
    """

    def __init__(self, context: Any) -> None:
        self._decoder = av.CodecContext.create(context.name, "r")
        if context.extradata:
            self._decoder.extradata = context.extradata
        self._times: dict[int, float] = {}

    def take(self, packet: Any, time_s: float) -> Iterator[tuple[Any, float]]:
        """Decode a packet due at `time_s`; yield frames, in order of display, and their times.

        Raises
        ------
        av.error.FFmpegError
            If the packet is damaged.
        """
        if len(self._times) > _MOST_TIMES:
            self._times.clear()
        self._times[packet.pts] = time_s
        for frame in self._decoder.decode(packet):
            place_s = self._times.pop(frame.pts, None)
            if place_s is not None:
                yield frame, place_s

    def restart(self) -> None:
        """Forget all frames: the next packet needs no other."""
        self._times.clear()
        self._decoder.flush_buffers()
