"""A mark that is rehearsed through the broadcaster's coder."""

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.coder_stream import CoderStream
from watermark.embed import AudioEmbedder
from watermark.profile import FS, ROBUST
from watermark.rehearsal import Rehearsal

Sound = NDArray[np.float32]


class Drowning:
    """A line that is 1000 samples late and drowns everything between two times in noise."""

    def __init__(self) -> None:
        self._rng, self._at = np.random.default_rng(0), 0
        self._tail = np.zeros((1000, 1), dtype=np.float32)

    def process(self, sound: Sound) -> Sound:
        late = np.concatenate([self._tail, sound])
        self._tail, late = late[-1000:], late[:-1000]
        time_s = (self._at + np.arange(len(late))) / FS
        self._at += len(late)
        bad = ((time_s > 5.2) & (time_s < 8.0))[:, np.newaxis]
        return (late + bad * self._rng.normal(0, 0.05, late.shape)).astype(np.float32)


def payload(k: int) -> tuple[bytes, bytes]:
    return np.random.default_rng(k).bytes(7), b""


def test_superframes_that_drown_are_asked_to_stand_higher() -> None:
    rng = np.random.default_rng(1)
    x = (rng.normal(0, 0.05, (12 * FS, 1))).astype(np.float32)
    rehearsal = Rehearsal(ROBUST, 0, Drowning())
    embedder = AudioEmbedder(FS, 1, payload, profile="robust", level=6, rehearsal=rehearsal)
    embedder.process(x)
    assert rehearsal.shortages() == {}  # a fixed level is not rehearsed
    embedder = AudioEmbedder(FS, 1, payload, profile="robust", rehearsal=rehearsal)
    embedder.process(x)
    short = rehearsal.shortages()
    assert np.median([short[k] for k in (9, 10, 11)]) > 2
    assert abs(np.median([short[k] for k in range(6)])) < 1
    again = AudioEmbedder(FS, 1, payload, profile="robust", shortages=short)
    plain = AudioEmbedder(FS, 1, payload, profile="robust")
    span = slice(round(6.0 * FS), round(7.5 * FS))
    power = [float(((e.process(x)[: 8 * FS][span] - x[span]) ** 2).sum()) for e in (again, plain)]
    assert power[0] > 1.2 * power[1]


@pytest.mark.parametrize("coder", ["aac:64k", "mp3:64k", "opus:64k", "mp2:192k", "ac3:192k"])
def test_coders_run_as_streams(coder: str) -> None:
    t = np.arange(FS) / FS
    x = (0.2 * np.sin(2 * np.pi * 440 * t))[:, np.newaxis].astype(np.float32)
    stream = CoderStream(coder)
    heard = np.concatenate([stream.process(x[i : i + 7000]) for i in range(0, FS, 7000)])
    assert heard.shape[1] == 2
    assert 0.8 * FS < len(heard) <= FS
    middle = heard[FS // 2 : FS // 2 + 4800, 0]
    assert abs(np.sqrt(2 * (middle**2).mean()) - 0.2) < 0.02


def test_unknown_coders_are_named() -> None:
    with pytest.raises(CueError, match=r"^coder 'aac': say it as aac:128k"):
        CoderStream("aac")
    with pytest.raises(CueError, match=r"^coder 'fdk:64k': say it"):
        CoderStream("fdk:64k")
