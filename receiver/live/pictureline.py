"""The picture of a broadcast: packets in, luma at a constant rate on the steady clock out.

Decoding pictures costs more than everything else that a receiver does. So a picture
without a mark rests, and is looked at again from time to time.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import av
from numpy.typing import NDArray

from codec.errors import CueError
from receiver.media.picture import PictureFormat, SteadyGrid, converted, luma_of, stream_format
from receiver.media.timed import TimedDecoder
from receiver.television.metrics import Metrics

REST_S = 60.0
"""Pause in seconds before a picture without a mark is searched again."""


@dataclass(frozen=True, slots=True)
class DecodedPicture:
    """A decoded picture.

    Attributes
    ----------
    luma : ndarray of uint8 or uint16, shape (height, width)
    time_s : float
        On the steady clock.
    fresh : bool
        Whether it begins a new run: the first one, or the first after a rest.
    """

    luma: NDArray[Any]
    time_s: float
    fresh: bool


class PictureLine:
    """Decodes the picture of one broadcast through all its connections.

    Parameters
    ----------
    metrics : Metrics

    Attributes
    ----------
    format : PictureFormat or None
        Of the output, once connected.
    """

    def __init__(self, metrics: Metrics) -> None:
        self._metrics = metrics
        self.format: PictureFormat | None = None
        self._grid: SteadyGrid | None = None
        self._decoder: TimedDecoder | None = None
        self._rests_until_s: float | None = None
        self._waits = True

    def connect(self, stream: Any) -> None:
        """Expect the packets of a new picture, perhaps of another form; None is no picture."""
        self.format = None
        if stream is None:
            return
        try:
            self.format = stream_format(stream, "broadcast")
        except CueError:  # nothing is lost but the mark in it
            return
        self._decoder = TimedDecoder(stream.codec_context)
        self._grid = SteadyGrid(self.format.fps)
        self.restart()

    def restart(self) -> None:
        """Begin a new run at the next picture that needs no other."""
        self._waits = True
        if self._grid is not None and self._decoder is not None:
            self._grid.restart()
            self._decoder.restart()

    def rest(self, now_s: float) -> None:
        """Leave the picture alone for a while."""
        self._rests_until_s = now_s + REST_S
        self.restart()

    def take(self, packet: Any, time_s: float) -> Iterator[DecodedPicture]:
        """Decode a packet that the steady clock has placed at `time_s`."""
        grid, decoder, form = self._grid, self._decoder, self.format
        if grid is None or decoder is None or form is None or not self._begins(packet, time_s):
            return
        try:
            frames = list(decoder.take(packet, time_s))
        except (av.error.FFmpegError, ValueError):
            self._metrics.add("damaged_packets_total")
            return
        for frame, place_s in frames:
            shown = converted(frame, form)
            for place, held in grid.put(shown, Fraction(round(place_s * 90_000), 90_000)):
                yield DecodedPicture(luma_of(held), float(grid.steady_time(place)), place == 0)

    def _begins(self, packet: Any, time_s: float) -> bool:
        """Whether a packet is to be decoded: not during a rest, nor before a new beginning."""
        if self._rests_until_s is not None and time_s < self._rests_until_s:
            return False
        self._rests_until_s = None
        if self._waits and not packet.is_keyframe:
            return False
        self._waits = False
        return True
