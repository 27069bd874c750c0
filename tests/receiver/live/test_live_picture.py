"""Live reception of a cuer in the picture: with unmarked sound, and without any."""

from collections.abc import Iterator
from fractions import Fraction
from io import BytesIO
from typing import Any

import av
import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.superframe.encoder import SuperframeEncoder
from receiver.live.broadcast import Broadcast, Happening
from receiver.reception.engine import Receiver
from receiver.reception.events import Event, MotionPiece
from receiver.reception.picture_search import TRIAL_S
from tests.receiver.standin import make_motion
from watermark.video.embed import VideoEmbedder
from watermark.video.profile import find_profile

VOICE = load_voice()
FPS, FS, WIDTH, HEIGHT = 25, 48_000, 320, 180
SECONDS = 5


def frames(count: int) -> Iterator[np.ndarray]:
    y, x = np.mgrid[:HEIGHT, :WIDTH] / HEIGHT
    for n in range(count):
        yield np.asarray(120 + 40 * np.sin(5 * x + n / 15) * np.cos(4 * y), dtype=np.uint8)


def marked(count: int) -> Iterator[np.ndarray]:
    profile = find_profile("twin")
    encoder = SuperframeEncoder(VOICE, l0_bytes=profile.l0_bytes, l1_bytes=profile.l1_bytes)
    motion = make_motion(VOICE, duration_s=8.0)

    def source(k: int) -> tuple[bytes, bytes]:
        superframe = encoder.encode(motion, k + 2)
        return superframe.l0, superframe.l1

    embedder = VideoEmbedder(WIDTH, HEIGHT, FPS, source, profile="twin")
    for luma in frames(count):
        yield from embedder.process(luma)
    yield from embedder.flush()


def stream(lumas: Iterator[np.ndarray], codec: str, *, sound: bool) -> bytes:
    file = BytesIO()
    with av.open(file, "w", format="mpegts") as out:
        picture: Any = out.add_stream(codec, rate=FPS)
        picture.width, picture.height, picture.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        picture.bit_rate, picture.gop_size = 4_000_000, 25
        heard: Any = None
        if sound:
            heard = out.add_stream("mp2", rate=FS)
            heard.layout = "mono"
        for n, luma in enumerate(lumas):
            shown = av.VideoFrame.from_ndarray(luma, format="gray").reformat(format="yuv420p")
            shown.pts, shown.time_base = n, Fraction(1, FPS)
            out.mux(picture.encode(shown))
            if heard is not None:
                block = np.zeros((1, FS // FPS), np.int16)
                silence = av.AudioFrame.from_ndarray(block, format="s16", layout="mono")
                silence.sample_rate, silence.pts = FS, n * FS // FPS
                silence.time_base = Fraction(1, FS)
                out.mux(heard.encode(silence))
        out.mux(picture.encode(None))
        if heard is not None:
            out.mux(heard.encode(None))
    return file.getvalue()


def receive(data: bytes) -> tuple[Broadcast, list[Happening]]:
    told: list[Happening] = []
    broadcast = Broadcast(BytesIO(data), VOICE, told.append, format="mpegts", once=True)
    broadcast.run()
    return broadcast, told


@pytest.mark.parametrize("sound", [True, False])
def test_the_picture_brings_the_cuer(sound: bool) -> None:
    _, told = receive(stream(marked(FPS * SECONDS), "libx264", sound=sound))
    starts = {round(h.start_s, 1) for h in told if isinstance(h, MotionPiece) and h.layers}
    assert len(starts) >= 6


def test_an_unmarked_picture_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[int] = []
    see = Receiver.see

    def counted(self: Receiver, luma: np.ndarray) -> list[Event]:
        looked.append(1)
        return see(self, luma)

    monkeypatch.setattr(Receiver, "see", counted)
    _, told = receive(stream(frames(FPS * round(TRIAL_S + 4)), "libx264", sound=True))
    assert not [h for h in told if isinstance(h, MotionPiece)]
    assert len(looked) == round(TRIAL_S * FPS) + 1
