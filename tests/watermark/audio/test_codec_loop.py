"""A mark that is rehearsed through the broadcaster's coder."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.dubbing.coder_stream import Breath, CoderChain, CoderStream, chains_of, make_rehearsal
from watermark.audio.embed.codec_loop import CodecLoop
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.embed.levels import HIGHEST_LEVEL
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.profile import DISCREET, FS, LEVELS, ROBUST, STANDARD

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


def marked(x: Sound, rehearsal: CodecLoop | None) -> Sound:
    embedder = AudioEmbedder(FS, 1, payload, profile="robust", rehearsal=rehearsal)
    blocks = [embedder.process(x[i : i + 5000]) for i in range(0, len(x), 5000)]
    return np.concatenate([*blocks, embedder.flush()])


def level(rehearsal: CodecLoop, k: int) -> float:
    enough = rehearsal.enough(k)
    assert enough is not None
    return enough


def test_superframes_that_drown_stand_higher() -> None:
    x = np.random.default_rng(1).normal(0, 0.05, (12 * FS, 1)).astype(np.float32)
    rehearsal = CodecLoop(ROBUST, 0, Drowning())
    y, plain = marked(x, rehearsal), marked(x, None)
    assert len(y) == len(x)
    assert min(level(rehearsal, k) for k in (7, 8, 9)) > 2 + max(
        level(rehearsal, k) for k in (1, 2)
    )
    assert rehearsal.enough(100) is None
    span = slice(round(4.5 * FS), round(6.0 * FS))
    power = [float(((z - x)[span] ** 2).sum()) for z in (y, plain)]
    assert power[0] > 1.2 * power[1]


def test_margins_are_reported_of_what_was_written() -> None:
    x = np.random.default_rng(1).normal(0, 0.05, (12 * FS, 1)).astype(np.float32)
    x[9 * FS : 11 * FS] = 0.0
    rehearsal = CodecLoop(ROBUST, 0, Clear(), Drowning(), names=("clear", "drowning"))
    embedder = AudioEmbedder(FS, 1, payload, profile="robust", rehearsal=rehearsal)
    embedder.process(x)
    embedder.flush()
    margins = {one.number: one for one in embedder.margins()}
    # The end cuts the last one off.
    assert len(margins) == embedder.report().superframes - 1
    assert max(margins) == 17
    assert 15 not in margins
    assert margins[10].coder == "drowning"
    assert margins[10].margin < margins[3].margin


class Asking(CodecLoop):
    """A rehearsal that asks for more than there is, and gives levels as margins."""

    def enough(self, number: int) -> float:
        return HIGHEST_LEVEL + 7.0

    def margin(self, number: int, level: float) -> tuple[float, str]:
        return level, "asking"


def test_only_marks_at_the_highest_level_of_all_are_the_loudest() -> None:
    x = np.random.default_rng(1).normal(0, 0.05, (6 * FS, 1)).astype(np.float32)
    asking = Asking(STANDARD, 0)
    embedder = AudioEmbedder(FS, 1, lambda k: (bytes(20), bytes(7)), grade=-1.5, rehearsal=asking)
    embedder.process(x)
    embedder.flush()
    levels = {one.margin: one.loudest for one in embedder.margins()}
    assert len(LEVELS) - 1 < min(levels) < max(levels) == HIGHEST_LEVEL
    assert levels == {level: level == HIGHEST_LEVEL for level in levels}


class Clear:
    """A line that changes nothing."""

    def process(self, sound: Sound) -> Sound:
        return sound


def test_what_is_enough_is_not_exceeded() -> None:
    """Where the line is clear the mark is softer than the grade allows, and still comes through."""
    x = np.random.default_rng(1).normal(0, 0.05, (12 * FS, 1)).astype(np.float32)
    softer, plain = marked(x, CodecLoop(ROBUST, 0, Clear())), marked(x, None)
    assert ((softer - x) ** 2).sum() < 0.8 * ((plain - x) ** 2).sum()
    receiver = AudioReceiver(FS, 1)
    found = receiver.process(softer) + receiver.flush()
    assert [s.l0 for s in found] == [payload(k)[0] for k in range(18)]


def test_the_worst_of_several_coders_counts() -> None:
    x = np.random.default_rng(1).normal(0, 0.05, (12 * FS, 1)).astype(np.float32)
    rehearsal = CodecLoop(ROBUST, 0, Clear(), Drowning())
    marked(x, rehearsal)
    assert level(rehearsal, 8) > level(rehearsal, 2) + 2


def test_a_fixed_level_is_not_rehearsed() -> None:
    rehearsal = CodecLoop(ROBUST, 0, Drowning())
    embedder = AudioEmbedder(FS, 1, payload, profile="robust", level=6, rehearsal=rehearsal)
    embedder.process(np.full((6 * FS, 1), 0.1, dtype=np.float32))
    assert rehearsal.count == 0


def test_most_are_rehearsed_unless_told_otherwise() -> None:
    assert make_rehearsal(ROBUST, 0, None) is not None
    assert make_rehearsal(ROBUST, 0, "none") is None
    assert make_rehearsal(STANDARD, 0, None) is not None
    assert make_rehearsal(DISCREET, 0, None) is None
    assert make_rehearsal(STANDARD, 0, "mp2:192k") is not None


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


def test_coders_in_a_row() -> None:
    t = np.arange(FS) / FS
    x = (0.2 * np.sin(2 * np.pi * 440 * t))[:, np.newaxis].astype(np.float32)
    chain = CoderChain(("mp2:192k", "ac3:192k"))
    heard = np.concatenate([chain.process(x[i : i + 7000]) for i in range(0, FS, 7000)])
    second, first = CoderStream("ac3:192k"), CoderStream("mp2:192k")
    np.testing.assert_array_equal(heard, second.process(first.process(x))[: len(heard)])
    with pytest.raises(CueError, match=r"^5 coders in a row, limit 4$"):
        CoderChain(("mp2:192k",) * 5)


@pytest.mark.parametrize(
    ("through", "chains"),
    [
        ("aac:128k,mp2:192k", [["aac:128k"], ["mp2:192k"]]),
        ("aac:128k,mp3:128k,aac:128k", [["aac:128k", "mp3:128k", "aac:128k"]]),
        ("mp2:192k+aac:128k,ac3:192k", [["mp2:192k", "aac:128k"], ["ac3:192k"]]),
    ],
)
def test_through_names_alternatives_and_chains(through: str, chains: list[list[str]]) -> None:
    assert [list(chain) for chain in chains_of(through)] == chains


def test_unknown_coders_are_named() -> None:
    with pytest.raises(CueError, match=r"^coder 'aac': say it as aac:128k"):
        CoderStream("aac")
    with pytest.raises(CueError, match=r"^coder 'fdk:64k': say it"):
        CoderStream("fdk:64k")


def test_grade_goes_where_it_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the grade does not suffice for all, every superframe is short by the same."""
    need = [6.0 + 3.0 * (k % 2) for k in range(20)]
    monkeypatch.setattr(CodecLoop, "enough", lambda _, k: need[k])
    written: list[float] = []
    stretch = AudioEmbedder._stretch

    def spy(self: AudioEmbedder, *args: Any) -> Any:
        if len(args) < 5:  # what is relieved in parts is made louder elsewhere
            written[self._next :] = args[3]
        return stretch(self, *args)

    monkeypatch.setattr(AudioEmbedder, "_stretch", spy)
    x = np.random.default_rng(1).normal(0, 0.05, (12 * FS, 1)).astype(np.float32)
    rehearsal = CodecLoop(ROBUST, 0, Clear())
    embedder = AudioEmbedder(FS, 1, payload, profile="robust", grade=-0.05, rehearsal=rehearsal)
    embedder.process(x)
    short = [a - b for a, b in zip(need, written, strict=False)][4:]
    assert len(short) == 8
    assert max(short) > 0.2
    assert max(short) - min(short) < 0.5


def test_breath_is_the_same_however_it_is_cut() -> None:
    sound = np.zeros((100_000, 2), np.float32)
    whole, breath = Breath(2).on(sound), Breath(2)
    parts = [breath.on(sound[a:b]) for a, b in ((0, 1), (1, 47_000), (47_000, 100_000))]
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert 20 * np.log10(np.std(whole)) == pytest.approx(-100, abs=0.1)
