"""A coder of pictures and its decoder as one stream: luma that viewers at home will see.

In: luma of a programme; out: the luma that came through, later by the coder's delay. On it the
embedder tries the mark. Codecs are those of PyAV.
"""

import math
import re
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.dubbing.coder_stream import chains_of
from cuecast.dubbing.denoiser import Denoiser
from cuecast.media.svt_av1 import SVT_AV1, priorities_kept
from cuecast.media.x264 import repeatable_options
from receiver.media.picture import luma_of
from watermark.video.coder_windows import PictureCoder
from watermark.video.design import has_small_cells
from watermark.video.profile import MIN_WIDTH
from watermark.video.strength_choice import TriedChannel

USUAL_RATE = 2_000_000
"""Bits per second of the coder without a choice: those of a frugal broadcast of 720 lines at 25
frames per second. Smaller pictures get less, by the square root of their pixels per second: .98
Mbit/s at 640x360 and 24. Five films chose that rule. There 2 Mbit/s, and .48 at `MOST_PRICE`, lost
L1 of 8 of 36 superframes of three films through x264 at 1 Mbit/s and of 9 through AV1; .98 loses
none and 4, and .12 to .17 of VMAF. With .48 at a price beside .98 a rocket lost .2 more."""

USUAL_PIXELS = 1280 * 720 * 25
"""Pixels per second of such a broadcast. Pictures with more have as many bits for each pixel in a
frugal broadcast, or the same rate in a poor one."""

RATE_ALIKE = 0.8
"""Part of `USUAL_PIXELS`, and its inverse, between which the rate is the usual one: a trial errs by
as much."""

MOST_PRICE = 2.0
"""Price of L1 at the lower of two rates, see `TriedChannel`: three decibels where all moves cost
alike. At any price a street with trees at 994 lines had 92.0 in place of 95.7. Through x264
veryfast a gymnast at 720 lines and 60 frames per second lost L1 of 9 superframes of 9 where it was
not asked for, 5 at a price of 1.6, which cost .2 of VMAF, 2 at any price, which cost .9; a desk at
1080 lines lost 7 of 11, 3 for .2, and none for 1.1."""

WITHOUT_COLOUR = 0.85
"""Part of a coder's rate that is left for luma."""

MOST_FRAMES = 25
"""Most frames between two that stand alone, which cost other frames their bits: a second of 25
pictures a second, half of one of 50, as on air."""

_ENCODERS: dict[str, tuple[str, dict[str, str], str]] = {
    "h264": ("libx264", {"preset": "veryfast"}, "h264"),
    "hevc": ("libx265", {"preset": "veryfast"}, "hevc"),
    "mpeg2": ("mpeg2video", {"bf": "2"}, "mpeg2video"),
    "av1": (SVT_AV1, {"preset": "10"}, "libdav1d"),
    "vp9": ("libvpx-vp9", {"deadline": "realtime", "cpu-used": "6"}, "vp9"),
}
"""Encoder, its options and the decoder of each name."""

SMALL_LINES, SMALL_RATE = 360, 4_000_000
"""Lines and bits per second of the small picture in MPEG-2 that the mark is tried on without a
choice: what many sets in standard definition get."""

SMALL_GOP = 600
"""Frames of the small picture from one that stands alone to the next, the most that FFmpeg's MPEG-2
allows: at few lines only these show weak values, and where they fall on air is luck. With 25, a
trial of a foggy film promised 2.5 to 3 times the information that L0 needs, and .7 to .9 arrived in
4 superframes of 12; with 600 all 12 were read."""

MPEG2_RATES = (24, 25, 30, 50, 60)
"""Whole frame rates that MPEG-2 has (ISO/IEC 13818-2, table 6-4)."""

USUAL_AV1 = "av1:1600k"
"""Coder on which L0 is tried without a choice for modern streams of 1 Mbit/s: SVT-AV1 spends less
than it is asked for, 1.12 Mbit/s of 1.6 and .76 of 1.0 in 70 s of seven films. At .85 of 1.0 a
trial found nothing left of L0 where 1.5 to 4.8 times what it needs arrived."""

CLEANER = "hqdn3d"
"""Name of the cleaner of noise."""

L0_ALONE = "l0"
"""Word before a row of coders behind which L0 alone has to arrive: where little arrives at all."""

Luma = NDArray[Any]


class PictureStream:
    """Code and decode without end.

    Parameters
    ----------
    coder : str
        Name and bit rate, such as ``h264:2000k``.
    width, height : int
        Pixels of the picture; an odd last row or column is left out.
    fps : Fraction
        Frames per second.
    depth : int
        Bits per sample; coded are 8.
    gop : int, optional
        Frames from one that stands alone to the next, if not a second of them or `MOST_FRAMES`.

    Raises
    ------
    CueError
        If there is no such coder, or not at this rate or size.

    Examples
    --------
    >>> stream = PictureStream("mpeg2:1000k", 320, 180, Fraction(25), 8)
    >>> frame = np.full((180, 320), 100, dtype=np.uint8)
    >>> decoded = stream.process(frame) + stream.process(frame) + stream.flush()
    >>> len(decoded), decoded[0].shape
    (2, (180, 320))
    """

    def __init__(
        self,
        coder: str,
        width: int,
        height: int,
        fps: Fraction,
        depth: int,
        *,
        gop: int | None = None,
    ) -> None:
        match = re.fullmatch(r"(\w+):([1-9]\d*)k", coder)
        if match is None or match[1] not in _ENCODERS:
            known = ", ".join(_ENCODERS)
            raise CueError(f"picture coder {coder!r}: say it as h264:2000k, known: {known}")
        name, options, decoder = _ENCODERS[match[1]]
        rate = int(int(match[2]) * 1000 * WITHOUT_COLOUR)
        self._shape, self._shift = (height, width), depth - 8
        self._even = 2 * (height // 2), 2 * (width // 2)
        try:
            encoder: Any = av.CodecContext.create(name, "w")
            encoder.height, encoder.width = self._even
            encoder.pix_fmt = "yuv420p"
            encoder.time_base, encoder.framerate = 1 / fps, fps
            encoder.bit_rate = rate
            encoder.gop_size = gop or min(round(fps), MOST_FRAMES)
            encoder.thread_count = 1
            encoder.options = options | _limits(name, rate)
            with priorities_kept():
                encoder.open()
            self._decoder: Any = av.CodecContext.create(decoder, "r")
            self._decoder.thread_count = 1
        except (av.FFmpegError, ValueError) as error:
            raise CueError(f"picture coder {coder!r}: {error}") from error
        self._encoder = encoder
        self._count = 0

    def process(self, luma: Luma) -> list[Luma]:
        """Take a frame; return the frames decoded by now, uint8, shape (height, width)."""
        frame = av.VideoFrame(self._even[1], self._even[0], "yuv420p")
        for plane in frame.planes[1:]:
            plane.update(bytes([128]) * plane.buffer_size)
        luma_of(frame)[:] = luma[: self._even[0], : self._even[1]] >> self._shift
        frame.pts, frame.time_base = self._count, self._encoder.time_base
        self._count += 1
        return self._decoded(self._encoder.encode(frame))

    def flush(self) -> list[Luma]:
        """Return the frames still inside."""
        return self._decoded([*self._encoder.encode(None), None])

    def _decoded(self, packets: list[Any]) -> list[Luma]:
        frames = [frame for packet in packets for frame in self._decoder.decode(packet)]
        return [self._padded(luma_of(frame)) for frame in frames]

    def _padded(self, luma: Luma) -> Luma:
        missing = [(0, n - m) for n, m in zip(self._shape, luma.shape, strict=True)]
        return np.pad(luma, missing, mode="edge") if any(n for _, n in missing) else luma.copy()


def _limits(encoder: str, rate: int) -> dict[str, str]:
    """Return the options that hold a rate over one second, as on air, with the same bits."""
    if encoder == SVT_AV1:
        return {"svtav1-params": "lp=1"}
    if encoder == "libx265":
        kilobits = rate // 1000
        return {
            "x265-params": f"vbv-maxrate={kilobits}:vbv-bufsize={kilobits}:log-level=none:"
            "pools=none:frame-threads=1"
        }
    limits = {"maxrate": str(rate), "bufsize": str(rate)}
    return limits | repeatable_options() if encoder == "libx264" else limits


class _SmallPicture:
    """Scale a picture to `SMALL_LINES` lines of 8 bits, or more if its cells need them."""

    def __init__(self, width: int, height: int, depth: int) -> None:
        # A portrait has more lines, so that it is wide enough for all columns of cells.
        lines = max(SMALL_LINES, 2 * math.ceil(MIN_WIDTH * height / width / 2))
        self.size = 2 * round(lines * width / height / 2), lines
        self._shift = depth - 8

    def process(self, luma: Luma) -> list[Luma]:
        even = luma[: luma.shape[0] // 2 * 2, : luma.shape[1] // 2 * 2] >> self._shift
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(even, np.uint8), format="gray")
        return [luma_of(frame.reformat(*self.size, interpolation="BICUBIC")).copy()]

    def flush(self) -> list[Luma]:
        return []


def _small_mpeg2(width: int, height: int, fps: Fraction, depth: int) -> PictureCoder:
    """Return the way to a set in standard definition, at as many bits a frame as it gets."""
    small = _SmallPicture(width, height, depth)
    rate = min(MPEG2_RATES, key=lambda rate: abs(rate - fps))
    coder = f"mpeg2:{round(SMALL_RATE * rate / fps / 1000)}k"
    return _PictureChain(
        [small, PictureStream(coder, *small.size, Fraction(rate), 8, gop=SMALL_GOP)]
    )


class _PictureChain:
    """Streams in a row."""

    def __init__(self, streams: list[PictureCoder]) -> None:
        self._streams = streams

    def process(self, luma: Luma) -> list[Luma]:
        lumas = [luma]
        for stream in self._streams:
            lumas = [out for each in lumas for out in stream.process(each)]
        return lumas

    def flush(self) -> list[Luma]:
        lumas: list[Luma] = []
        for stream in self._streams:
            lumas = [out for each in lumas for out in stream.process(each)] + stream.flush()
        return lumas


def picture_channels(
    through: str | None, width: int, height: int, fps: Fraction, depth: int, *, most_bps: int = 0
) -> list[TriedChannel]:
    """Prepare the coders that a mark is tried on.

    Parameters
    ----------
    through : str or None
        See `chains_of`; ``hqdn3d`` in a row is a cleaner of noise. Behind it, and in a row that
        begins with ``l0``, L0 alone has to arrive. ``none`` for no trial. None for H.264 at
        `USUAL_RATE`, less for fewer pixels per second than `USUAL_PIXELS`; for more also at a
        higher rate, and at the lower for L1 at `MOST_PRICE` at most. For L0 alone H.264 at
        `USUAL_RATE` behind a cleaner, `USUAL_AV1` unless the picture is small, and MPEG-2 at
        `SMALL_LINES`; the widest step only for `USUAL_RATE` and `USUAL_AV1`.
    width, height, fps, depth
        Of the picture.
    most_bps : int
        Most bits per second without a choice: the rate of the file to be written; 0 for any.

    Raises
    ------
    CueError
        If there is no such coder.

    Examples
    --------
    >>> [channel.whole for channel in picture_channels(
    ...     "h264:500k,hqdn3d+h264:500k,l0+av1:200k", 640, 360, Fraction(25), 8
    ... )]
    [True, False, False]
    """
    if through == "none":
        return []
    if through is None:
        return _usual_channels(width, height, fps, depth, most_bps)
    channels = []
    for words in chains_of(through):
        names = words[words[0] == L0_ALONE and len(words) > 1 :]
        whole = CLEANER not in names and names == words
        channels.append(_channel(partial(_chain, names, width, height, fps, depth), whole))
    return channels


def _channel(make: Callable[[], PictureCoder], whole: bool, **options: Any) -> TriedChannel:
    """Return a channel with its coder for the trial and that for the rehearsal."""
    return TriedChannel(make(), whole, again=make(), **options)


def _chain(
    names: Sequence[str], width: int, height: int, fps: Fraction, depth: int
) -> PictureCoder:
    """Return the coders and cleaners of these names in a row."""
    streams: list[PictureCoder] = []
    for name in names:
        known = 8 if streams else depth
        streams.append(
            Denoiser(known) if name == CLEANER else PictureStream(name, width, height, fps, known)
        )
    return _PictureChain(streams)


def _usual_channels(
    width: int, height: int, fps: Fraction, depth: int, most_bps: int
) -> list[TriedChannel]:
    """Return the channels without a choice, see `picture_channels`."""
    share = width * height * float(fps) / USUAL_PIXELS
    if share > 1 / RATE_ALIKE:
        rates = [share * USUAL_RATE, USUAL_RATE]
    else:
        rates = [USUAL_RATE if share > RATE_ALIKE else math.sqrt(share) * USUAL_RATE]
    limited: dict[int, int] = {}
    for bps in rates:
        # Wide steps are for what is hard to code at the rate that all share: they can be seen.
        limited.setdefault(_kilobits(bps, most_bps), 2 if bps == USUAL_RATE else 1)
    chain = partial(_chain, width=width, height=height, fps=fps, depth=depth)
    channels = []
    for n, (rate, widest) in enumerate(limited.items()):
        # A poorer way may not cost a richer one its L1.
        price = MOST_PRICE if n else math.inf
        make = partial(chain, [f"h264:{rate}k"])
        channels.append(_channel(make, True, widest=widest, lone=not n, price=price))
    # Through these coders, which leave less, L0 alone has to arrive.
    poor = [([CLEANER, f"h264:{_kilobits(USUAL_RATE, most_bps)}k"], 1)]
    if not has_small_cells((height, width)):
        poor.append(([USUAL_AV1], 2))
    for names, widest in poor:
        channels.append(_channel(partial(chain, names), False, widest=widest, lone=False))
    # Through MPEG-2 at more lines, L1 arrives, too.
    make = partial(_small_mpeg2, width, height, fps, depth)
    channels.append(_channel(make, False, widest=1, lone=False, hoped=True))
    return channels


def _kilobits(bps: float, most_bps: int) -> int:
    """Return a rate in kbit/s, at most that of the file to be written (0: any)."""
    return max(1, round(min(bps, most_bps or bps) / 1000))
