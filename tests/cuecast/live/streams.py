"""Sound in packets and transport streams, as FFmpeg makes them."""

import functools
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from cuecast.demo.content import FS, make_sound
from cuecast.live.packets import pid_of
from cuecast.media.tables import PACKET

SOUND_PID = 257

ENCODERS = {
    "mp2": ("mp2", 192_000),
    "aac": ("aac", 128_000),
    "latm": ("aac", 96_000),
    "ac3": ("ac3", 256_000),
    "eac3": ("eac3", 192_000),
}


@functools.cache
def programme() -> NDArray[np.float32]:
    """Sound in stereo, shape (n, 2)."""
    sound: NDArray[np.float32] = make_sound()[0]
    return sound


def coded(kind: str, sound: NDArray[np.float32], fs: int = FS) -> list[tuple[int, bytes]]:
    """FFmpeg's packets of a sound, shape (n, 2), and the number of their first sample."""
    name, rate = ENCODERS[kind]
    coder: Any = av.CodecContext.create(name, "w")
    coder.sample_rate, coder.layout, coder.bit_rate = fs, "stereo", rate
    coder.format = "s16" if kind == "mp2" else "fltp"
    coder.open()
    out = []
    for start in range(0, len(sound) - coder.frame_size + 1, coder.frame_size):
        part = sound[start : start + coder.frame_size]
        plain: NDArray[Any] = np.ascontiguousarray(part.T)
        if kind == "mp2":
            plain = np.round(part * 32767).astype(np.int16).reshape(1, -1)
        frame = av.AudioFrame.from_ndarray(plain, coder.format.name, "stereo")
        frame.sample_rate, frame.pts, frame.time_base = fs, start, Fraction(1, fs)
        out += [(p.pts, bytes(p)) for p in coder.encode(frame)]
    return out


def transport_stream(path: Path, seconds: int = 4) -> bytes:
    """A stream of FFmpeg's: picture, MPEG audio, a second sound, empty packets."""
    sound = programme()[: seconds * FS]
    with av.open(str(path), "w", format="mpegts", options={"muxrate": "900000"}) as out:
        picture: Any = out.add_stream("mpeg2video", rate=25)
        picture.width = picture.height = 64
        picture.pix_fmt = "yuv420p"
        sounds: list[Any] = [out.add_stream(name, rate=FS) for name in ("mp2", "aac")]
        for stream, rate in zip(sounds, (192_000, 96_000), strict=True):
            stream.layout, stream.bit_rate = "stereo", rate
        for n in range(25 * seconds):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), n, np.uint8), format="rgb24")
            frame.pts, frame.time_base = n, Fraction(1, 25)
            out.mux(picture.encode(frame))
            part = sound[n * FS // 25 : (n + 1) * FS // 25]
            for stream in sounds:
                plain: NDArray[Any] = np.ascontiguousarray(part.T)
                if stream is sounds[0]:
                    plain = np.round(part * 32767).astype(np.int16).reshape(1, -1)
                heard = av.AudioFrame.from_ndarray(
                    plain, "s16" if stream is sounds[0] else "fltp", "stereo"
                )
                heard.sample_rate, heard.pts = FS, n * FS // 25
                heard.time_base = Fraction(1, FS)
                out.mux(stream.encode(heard))
        for stream in (picture, *sounds):
            out.mux(stream.encode(None))
    return path.read_bytes()


def packets_of(data: bytes, pid: int) -> list[bytes]:
    parts = (data[at : at + PACKET] for at in range(0, len(data), PACKET))
    return [part for part in parts if pid_of(part) == pid]
