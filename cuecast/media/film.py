"""A new film from samples and pictures, for the demonstration and the tests."""

import os
from collections.abc import Iterable
from fractions import Fraction
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.files.whole import whole_file
from cuecast.media.encode import SoundEncoder, SoundTarget
from receiver.media.programme import SoundFormat

_LAYOUTS = {1: "mono", 2: "stereo", 3: "2.1", 4: "4.0", 5: "5.0", 6: "5.1", 7: "6.1", 8: "7.1"}

_BLOCK = 4096
"""Samples that are coded at once."""


def write_film(
    path: str | os.PathLike[str],
    sound: NDArray[np.float32],
    fs: int,
    *,
    encoder: str,
    bit_rate: int = 0,
    pictures: Iterable[NDArray[np.uint8]] = (),
    picture_rate: int = 25,
    picture_codec: str = "libx264",
) -> None:
    """Write a sound file, or a film with sound.

    Parameters
    ----------
    path : path
        Its suffix names the container.
    sound : ndarray of float32, shape (n, channels)
        Full scale is 1; 1 to 8 channels.
    fs : int
        Sampling rate in Hz.
    encoder : str
        FFmpeg's name of the sound encoder.
    bit_rate : int
        Of the sound, bit/s; 0 for a lossless encoder.
    pictures : iterable of ndarray of uint8, shape (height, width, 3)
        Red, green, blue; even height and width. None: the file has no picture.
    picture_rate : int
        Pictures per second.

    Raises
    ------
    CueError
        If the container or the encoder refuses.
    """
    channels = sound.shape[1]
    layout = _LAYOUTS[channels]
    with whole_file(path) as temporary, av.open(f"file:{temporary}", "w") as container:
        picture: Any = None
        pending = iter(pictures)
        first = next(pending, None)
        if first is not None:
            picture = container.add_stream(picture_codec, rate=picture_rate)
            picture.height, picture.width = first.shape[:2]
            picture.pix_fmt = "yuv420p"
            picture.options = {"crf": "20", "preset": "veryfast"}
            # One thread: the file is the same on every machine.
            picture.codec_context.thread_count = 1
        form = SoundFormat(encoder, fs, channels, layout, "s16", bit_rate)
        sounding = SoundEncoder(container, form, SoundTarget(encoder, bit_rate))
        sounding.open()
        shown = 0
        for start in range(0, len(sound), _BLOCK):
            while picture is not None and first is not None and shown * fs <= start * picture_rate:
                frame = av.VideoFrame.from_ndarray(first, format="rgb24")
                frame.pts, frame.time_base = shown, Fraction(1, picture_rate)
                container.mux(picture.encode(frame))
                first = next(pending, None)
                shown += 1
            for packet in sounding.process(sound[start : start + _BLOCK], 0.0):
                container.mux(packet)
        if picture is not None:
            container.mux(picture.encode(None))
        for packet in sounding.flush():
            container.mux(packet)
