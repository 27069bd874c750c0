"""Adapting never does worse than not adapting, whatever was learnt, needed, rehearsed or guessed.

Each property hands one adapting part something wrong, drawn at random, and asks for what is there
without it.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.watermark.audio.test_carrier import embed, host, payload
from watermark.audio.embed.codec_loop import CodecLoop
from watermark.audio.embed.design import MarkDesigner
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.embed.level_control import GIVE_UP, QUIETEST, LevelControl
from watermark.audio.follow.align import CLUE_LIMIT, SuperframeView, read_view
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.follow.equaliser import Equaliser
from watermark.audio.follow.reliability import LARGEST_EXPONENT, LIMITS
from watermark.audio.follow.track import Track
from watermark.audio.follow.track_reader import TrackReader
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.profile import LEVELS, STANDARD, SUPERFRAME, USUAL_GRADE
from watermark.audio.signal.sample_buffer import SampleBuffer

FS = 48000
Sound = NDArray[np.float32]


@pytest.fixture(scope="module")
def marked() -> Sound:
    return embed(host(4.0, channels=1))


def tape_of(sound: Sound) -> SampleBuffer:
    tape = SampleBuffer()
    tape.append(sound.mean(axis=1).astype(np.float64))
    return tape


def misled(rng: np.random.Generator) -> Demodulator:
    """A demodulator that has learnt anything that it may."""
    demodulator = Demodulator(STANDARD, 0)
    reliability = demodulator.reliability
    reliability._resultant[:] = rng.choice(LIMITS, STANDARD.groups, p=(0.9, 0.1))
    reliability._exponents[:] = rng.uniform(-LARGEST_EXPONENT, LARGEST_EXPONENT, 3)
    return demodulator


def test_weights_and_clues(marked: Sound) -> None:
    """What a receiver without a past reads in noise, one with any past reads, too."""
    rng, read = np.random.default_rng(0), 0
    for noise in (0.0155, 0.0165):
        tape = tape_of(marked + rng.normal(0, noise, marked.shape).astype(np.float32))
        for k in range(1, 5):
            view = read_view(tape, float(k * SUPERFRAME), 1.0, make_masker())
            fresh = Demodulator(STANDARD, 0)
            levels = fresh.likely_levels(view, 6)
            if fresh.read(view, levels[:2]).decoded.l0 == payload(k)[0]:
                read += 1
                assert misled(rng).read(view, levels).decoded.l0 == payload(k)[0]
    assert read >= 3


class Misleading(SuperframeView):
    """Half its frames hold the message, the other half are noise that looks certain."""

    def clues(self, *_: Any) -> NDArray[np.float64]:
        return np.tile(1.0 - 2.0 * HOLDING, (3, 1, STANDARD.groups))

    def soft(self, cells: Cells, step: float) -> NDArray[np.float64]:
        return self.amplitudes

    def errors(self, cells: Cells, step: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        shape = (64, cells.dither.size)
        return np.broadcast_to(0.25 * HOLDING, shape), np.ones(shape, dtype=bool)


HOLDING = np.arange(64)[:, np.newaxis] % 2 == 0


@pytest.mark.parametrize("seed", range(2))
def test_what_nothing_learnt_from(seed: int) -> None:
    """Where all that was learnt and all that shows misleads, the plain weights read."""
    rng, demodulator = np.random.default_rng(seed), misled(np.random.default_rng(seed))
    demodulator.reliability._exponents[:] = LARGEST_EXPONENT
    ideal = demodulator.layout.spread(1.0 - 2.0 * demodulator.link.encode(*payload(1)))
    soft = np.clip(0.6 * HOLDING * ideal + rng.normal(0, 0.6, ideal.shape), -1, 1)
    view = Misleading(np.zeros((64, 480), dtype=np.complex128), soft)
    assert demodulator.read(view, [5.0]).decoded.l0 == payload(1)[0]


def test_clues_are_bounded(marked: Sound) -> None:
    view = read_view(tape_of(marked), float(SUPERFRAME), 1.0, make_masker())
    loud = SuperframeView(
        view.spectra * np.geomspace(1e-6, 1e6, 64)[:, np.newaxis], view.amplitudes
    )
    clues = loud.clues(Demodulator(STANDARD, 0).layout.cells, make_masker())
    assert np.abs(clues).max() <= CLUE_LIMIT


@pytest.mark.parametrize("seed", range(6))
def test_level_gain_phases_and_clock(marked: Sound, seed: int) -> None:
    """A track that is wrong in all that it has learnt still reads what lies at its place."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(0, 0.013, marked.shape).astype(np.float32)
    reader, tape = TrackReader(0, 1.0), tape_of(marked + noise)
    demodulator = reader.demodulator(STANDARD.number)
    bands, level = demodulator.bands, float(rng.integers(len(LEVELS)))
    track = Track(2.0 * SUPERFRAME, 1.0, demodulator, 6.0, Equaliser(bands))
    phases = Equaliser(bands, rng.uniform(-np.pi, np.pi, bands))
    for wrong in (
        track,
        replace(track, level=level),
        replace(track, level=level, offset=1.5),
        replace(track, equaliser=phases),
    ):
        raw = reader.view(tape, wrong)
        assert reader.read(tape, wrong, raw, due=True).decoded.l0 == payload(2)[0]
    drift = rng.uniform(-6e-5, 6e-5)
    led_astray = replace(track, position=track.position + drift * SUPERFRAME / 2, ratio=1 + drift)
    places = reader.elsewhere(tape, led_astray, reader.view(tape, led_astray))
    assert abs(next(places).position - track.position) < 0.01


class Line:
    """A line that adds noise of some deviation."""

    def __init__(self, noise: float = 0.004) -> None:
        self._rng, self._noise = np.random.default_rng(0), noise

    def process(self, sound: Sound) -> Sound:
        return (sound + self._rng.normal(0, self._noise, sound.shape)).astype(np.float32)


def heard(x: Sound, rehearsal: CodecLoop | None, line: Line) -> tuple[int, float]:
    """Superframes that come through a line, and the grade of the mark."""
    embedder = AudioEmbedder(FS, 1, payload, rehearsal=rehearsal)
    y = np.concatenate([embedder.process(x), embedder.flush()])
    receiver = AudioReceiver(FS, 1)
    found = receiver.process(line.process(y)) + receiver.flush()
    got = {(s.l0, s.l1) for s in found}
    grade = embedder.report().odg
    assert grade is not None
    return sum(payload(k) in got for k in range(len(x) // SUPERFRAME)), grade


@pytest.mark.parametrize("seed", range(2))
def test_rehearsal(seed: int) -> None:
    """A rehearsed mark comes through where the plain one does, at no worse a grade."""
    x = host(7.0, channels=1, seed=seed)
    plain, _ = heard(x, None, Line())
    rehearsed, grade = heard(x, CodecLoop(STANDARD, 0, Line()), Line())
    assert rehearsed >= plain
    assert grade > USUAL_GRADE - 0.08


class Loud:
    """A stretch that is heard at any base level but the quietest."""

    def __init__(self, base: float | None) -> None:
        rng = np.random.default_rng(0)
        self.base, self.clean = base, host(2.56, channels=1).astype(np.float64)
        amount = 0.0 if base is None else 1e-4 if base == QUIETEST else 0.05
        self.marked = self.clean + amount * rng.normal(size=self.clean.shape)


def test_need_that_is_heard() -> None:
    """A stretch whose needs are heard at any base is written without them, not left unmarked."""
    made = LevelControl(USUAL_GRADE, 1).settle(Loud)
    assert made.base == QUIETEST


@pytest.mark.parametrize("seed", range(2))
def test_need_and_a_rehearsal_that_lies(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever need and rehearsal say, a clear line is served at a bounded grade.

    In a few seconds the loop holds what it promises of each stretch, not yet that of a passage.
    """
    rng = np.random.default_rng(seed)
    monkeypatch.setattr(MarkDesigner, "need", lambda *_: float(rng.uniform(-12, 24)))
    monkeypatch.setattr(CodecLoop, "enough", lambda *_: float(rng.uniform(-12, 24)))
    x = host(7.0, channels=1, seed=seed)
    came, grade = heard(x, CodecLoop(STANDARD, 0, Line()), Line(0.0))
    assert came == len(x) // SUPERFRAME
    assert grade > USUAL_GRADE - GIVE_UP
