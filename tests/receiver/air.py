"""Programmes with a cuer inside, made in memory: sound, and transport streams of it."""

from fractions import Fraction
from io import BytesIO
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.superframe.encoder import SuperframeEncoder
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.signal.profile import STANDARD

FS = 48000


def marked_noise(voice: Voice, motion: Motion, seconds: int) -> NDArray[np.float32]:
    """Murmuring noise, one channel, with the cuer inside."""
    rng = np.random.default_rng(5)
    noise = np.convolve(rng.normal(0, 1, seconds * FS), np.exp(-np.arange(60) / 9), "same")
    envelope = 0.6 + 0.4 * np.sin(2 * np.pi * 3.1 * np.arange(seconds * FS) / FS)
    host = (0.03 * noise * envelope).astype(np.float32)[:, None]
    encoder = SuperframeEncoder(voice, l0_bytes=STANDARD.l0_bytes, l1_bytes=STANDARD.l1_bytes)

    def source(k: int) -> tuple[bytes, bytes]:
        superframe = encoder.encode(motion, k + 2)
        return superframe.l0, superframe.l1

    embedder = AudioEmbedder(FS, 1, source)
    return np.concatenate([embedder.process(host), embedder.flush()])


def transport_stream(
    sound: NDArray[np.float32],
    *, fps: int = 25, codec: str = "aac", start_s: float = 0.0, picture_codec: str = "libx264",
    interlaced: bool = False, container: str = "mpegts", size: tuple[int, int] = (320, 180),
) -> bytes:  # fmt: skip
    """An MPEG transport stream of a walking bar and `sound` (n, 1), coded at 192 kbit/s."""
    file = BytesIO()
    with av.open(file, "w", format=container) as out:
        picture: Any = out.add_stream(picture_codec, rate=fps)
        (picture.width, picture.height), picture.pix_fmt = size, "yuv420p"
        picture.options = {"preset": "ultrafast", "g": str(fps // 2), "tune": "zerolatency"}
        if picture_codec != "libx264":
            flags = {"flags": "+ildct+ilme"} if interlaced else {}
            picture.options = {"g": "12", "bf": "2", **flags} if container == "mpegts" else {}
            picture.bit_rate = 3_000_000
        voice: Any = out.add_stream(codec, rate=FS)
        voice.bit_rate, voice.layout = 192_000, "mono"
        per_picture = FS // fps
        for number in range(len(sound) // per_picture):
            image = np.full((*size[::-1], 3), (24, 32, 60), np.uint8)
            image[:, number * 2 % 300 :][:, :12] = (200, 180, 90)
            shown = av.VideoFrame.from_ndarray(image, format="rgb24")
            shown.time_base, shown.pts = Fraction(1, fps), number + round(start_s * fps)
            out.mux(picture.encode(shown))
            part = sound[number * per_picture : (number + 1) * per_picture]
            kind = "fltp" if codec == "aac" else "s16"
            samples = np.ascontiguousarray(part.T)
            if kind == "s16":
                samples = np.rint(samples * 32767).astype(np.int16)
            heard = av.AudioFrame.from_ndarray(samples, format=kind, layout="mono")
            heard.sample_rate, heard.time_base = FS, Fraction(1, FS)
            heard.pts = number * per_picture + round(start_s * FS)
            out.mux(voice.encode(heard))
        out.mux(picture.encode(None))
        out.mux(voice.encode(None))
    return file.getvalue()
