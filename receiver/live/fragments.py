"""Fragmented MP4 for the browser, made while the programme runs.

Packets of picture (copied) or frames (coded to H.264) and blocks of sound (coded to AAC) go in,
boxes come out: first the initialisation (``ftyp``, ``moov``), then fragments (``moof``, ``mdat``)
that start with a picture that needs no other, as long as such pictures come often enough.
ISO/IEC 14496-12, section 8.8.
"""

import struct
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from receiver.live.recode import PlainPictures

_CLOCK = 90_000
"""Ticks of a transport stream's clock in a second."""

_SOUND_BPS = 160_000
"""Bits per second of the sound for the browser."""

_LONGEST_S = {"sound": 0.5, "picture": 4.0}
"""A fragment is out after this long: sound alone has nothing else to cut it, and some programmes
refresh their picture bit by bit."""

BROWSER_PICTURE = {"h264": "avc1.640028", "hevc": "hvc1.1.6.L120.90"}
"""Picture codecs that browsers play out of MP4, with a name for them."""


def playable(picture: Any) -> bool:
    """Return whether browsers can play a picture stream, and its size is known."""
    codec = picture.codec_context
    return codec.name in BROWSER_PICTURE and codec.width > 0


class BoxSplitter:
    """A writable file that cuts its content into top-level boxes.

    Examples
    --------
    >>> splitter = BoxSplitter()
    >>> splitter.write(bytes([0, 0, 0, 9]) + b"free" + b"x" + bytes([0, 0, 0]))
    12
    >>> [(kind, len(box)) for kind, box in splitter.take()]
    [(b'free', 9)]
    """

    def __init__(self) -> None:
        self._held = b""

    def write(self, data: bytes) -> int:
        """Take bytes."""
        self._held += bytes(data)
        return len(data)

    def take(self) -> list[tuple[bytes, bytes]]:
        """Return the boxes that are complete: (type, whole box)."""
        boxes = []
        while len(self._held) >= 8:
            size, kind = struct.unpack_from(">I4s", self._held)
            if size < 8 or len(self._held) < size:
                break
            boxes.append((kind, self._held[:size]))
            self._held = self._held[size:]
        return boxes


@dataclass(slots=True)
class Fragments:
    """Output of `FragmentWriter`: initialisation and fragments that are new.

    Attributes
    ----------
    start : bytes
        Initialisation, empty unless it is new.
    fragments : list of bytes
    """

    start: bytes = b""
    fragments: list[bytes] = field(default_factory=list)


class FragmentWriter:
    """Writes one run of programme as fragmented MP4.

    Parameters
    ----------
    picture : av stream or PlainPictures, optional
        Template of the picture, whose codec is one of `BROWSER_PICTURE`, or what gives frames.
    fs : int
        Sampling rate of the sound; 0 if there is none.
    channels : int
    """

    def __init__(self, picture: Any, fs: int, channels: int) -> None:
        self._splitter = BoxSplitter()
        longest_s = _LONGEST_S["sound" if picture is None else "picture"]
        self._container = av.open(
            self._splitter,
            "w",
            format="mp4",
            options={
                "movflags": "frag_keyframe+empty_moov+default_base_moof+delay_moov+frag_discont",
                "frag_duration": str(round(1e6 * longest_s)),
                "use_editlist": "0",
                "avoid_negative_ts": "disabled",
            },
        )
        codec = self._add_picture(picture)
        self._sound = None
        if fs:
            self._sound = self._container.add_stream("aac", rate=fs)
            self._sound.bit_rate = _SOUND_BPS
            self._sound.layout = "mono" if channels == 1 else "stereo"
        self._channels = channels
        self._fs = fs
        self._written = 0
        self._start: list[bytes] = []
        self._head = b""
        names = [BROWSER_PICTURE[codec]] if codec else []
        self.mime = 'video/mp4; codecs="{}"'.format(", ".join([*names, *["mp4a.40.2"] * (fs > 0)]))

    def _add_picture(self, picture: Any) -> str:
        """Add the stream of the picture; return the name of its codec."""
        self._picture: Any = None
        self._recodes = False
        if picture is None:
            return ""
        if not isinstance(picture, PlainPictures):
            self._picture = self._container.add_stream_from_template(picture)
            return str(picture.codec_context.name)
        self._recodes = True
        self._picture = self._container.add_stream("libx264", rate=picture.rate)
        self._picture.width, self._picture.height = picture.width, picture.height
        self._picture.pix_fmt = "yuv420p"
        self._picture.codec_context.time_base = Fraction(1, _CLOCK)
        self._picture.options = {
            "preset": "ultrafast",
            "tune": "zerolatency",
            "crf": "21",
            "g": str(max(1, round(picture.rate / 2))),
            "threads": "1",
        }
        return "h264"

    def frame(self, frame: Any, time_s: float) -> Fragments:
        """Code a frame to be shown at `time_s`."""
        frame.time_base, frame.pts = Fraction(1, _CLOCK), round(time_s * _CLOCK)
        frame.pict_type = 0
        self._container.mux(self._picture.encode(frame))
        return self._take()

    def picture(self, packet: Any, time_s: float) -> Fragments:
        """Take a coded picture to be shown at `time_s`."""
        if packet.dts is None or packet.pts is None:
            return Fragments()
        shift = round(time_s / packet.time_base) - packet.pts
        packet.pts += shift
        packet.dts += shift
        packet.stream = self._picture
        self._container.mux(packet)
        return self._take()

    def sound(self, block: NDArray[np.float32], time_s: float) -> Fragments:
        """Take samples (n, channels) that begin at `time_s`."""
        assert self._sound is not None
        if not self._written:
            self._written = round(time_s * self._fs)
        shown = block if self._channels <= 2 else block[:, :2]
        frame = av.AudioFrame.from_ndarray(
            np.ascontiguousarray(shown.T), format="fltp", layout=self._sound.layout.name
        )
        frame.sample_rate = self._fs
        frame.time_base = Fraction(1, self._fs)
        frame.pts = self._written
        self._written += len(block)
        self._container.mux(self._sound.encode(frame))
        return self._take()

    def close(self) -> Fragments:
        """Return the remaining boxes."""
        if self._sound is not None and self._written:
            self._container.mux(self._sound.encode(None))
        if self._recodes:
            self._container.mux(self._picture.encode(None))
        self._container.close()
        return self._take()

    def _take(self) -> Fragments:
        out = Fragments()
        for kind, box in self._splitter.take():
            if kind in (b"ftyp", b"moov"):
                self._start.append(box)
                if kind == b"moov":
                    out.start = b"".join(self._start)
            elif kind == b"moof":
                self._head = box
            elif kind == b"mdat":
                out.fragments.append(self._head + box)
        return out
