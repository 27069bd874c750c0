"""Pictures that browsers do not play (MPEG-2 of broadcasting), decoded for coding them anew.

Packets go in, frames with square pixels and without interlacing come out; `receiver.live.fragments`
codes them as H.264. Meant for standard definition on one core; larger pictures are made smaller.
"""

from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import av

from receiver.media.timed import TimedDecoder

RECODED = ("mpeg2video", "mpeg1video", "mpeg4", "vc1", "theora")
"""Picture codecs that are recoded."""

_MAX_WIDTH, _MAX_HEIGHT = 1280, 720
"""Pixels of pictures that are coded anew at most: a bound on the processor's time."""


def recodable(picture: Any) -> bool:
    """Return whether a picture stream can be recoded for browsers."""
    codec = picture.codec_context
    return codec.name in RECODED and codec.width > 0


class PlainPictures:
    """Frames of one picture stream as browsers can be given them.

    Parameters
    ----------
    stream : av stream
        Announces codec and form.

    Attributes
    ----------
    name : str
        Of the codec.
    width, height : int
        Of the frames that come out, even.
    rate : Fraction
        Frames per second.
    """

    def __init__(self, stream: Any) -> None:
        codec = stream.codec_context
        self.name: str = codec.name
        aspect = float(codec.sample_aspect_ratio or 1)
        shrunk = min(1.0, _MAX_WIDTH / (codec.width * aspect), _MAX_HEIGHT / codec.height)
        self.width = 2 * round(codec.width * aspect * shrunk / 2)
        self.height = 2 * round(codec.height * shrunk / 2)
        self.rate = stream.average_rate or stream.guessed_rate
        self._decoder = TimedDecoder(codec)
        self._graph: Any = None
        self._form: tuple[int, int, str] = (0, 0, "")
        self._inside: deque[float] = deque()  # times of the frames that the filters hold

    def take(self, packet: Any, time_s: float) -> Iterator[tuple[Any, float]]:
        """Decode a packet to be shown at `time_s`; yield frames and their times.

        Raises
        ------
        av.error.FFmpegError
            If the packet is damaged.
        """
        for frame, shown_s in self._decoder.take(packet, time_s):
            if frame.is_corrupt:
                continue
            form = (frame.width, frame.height, frame.format.name)
            if self._graph is None or form != self._form:
                self._graph, self._form = self._filters(frame), form
                self._inside.clear()
            self._graph.push(frame)
            self._inside.append(shown_s)
            while self._inside:
                try:
                    out = self._graph.pull()
                except (av.error.BlockingIOError, av.error.EOFError):
                    break
                yield out, self._inside.popleft()

    def _filters(self, frame: Any) -> Any:
        """Return a graph that deinterlaces where needed and scales to square pixels."""
        graph = av.filter.Graph()
        source = graph.add_buffer(
            width=frame.width, height=frame.height, format=frame.format, time_base=frame.time_base
        )
        chain = [
            source,
            graph.add("yadif", "mode=send_frame:deint=interlaced"),
            graph.add("scale", f"{self.width}:{self.height}:flags=bilinear"),
            graph.add("setsar", "1"),
            graph.add("format", "yuv420p"),
            graph.add("buffersink"),
        ]
        for first, second in pairwise(chain):
            first.link_to(second)
        graph.configure()
        return graph
