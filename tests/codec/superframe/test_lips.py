"""The lips' contract at the receiver."""

import numpy as np
import pytest

from codec.cuer.motion import Motion
from codec.cuer.voice import load_voice
from codec.cues.cueing import SHAPE_OF, cue
from codec.cues.phonology import PHONE_NUMBER, PHONES
from codec.cues.score import Phone, Score
from codec.cues.timeline import Sounding
from codec.superframe.coding import coding_for
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.lips import LipContract

VOICE = load_voice()
CONTRACT = LipContract(VOICE)
WORDS = "a p a f i b u v e m y t a z o f ɛ p i m a s ɔ̃ b a k i v a".split()


def line_of(symbols: list[str], ticks: int = 6) -> list[Sounding]:
    return [
        Sounding(PHONE_NUMBER[s], 10 + i * ticks, 10 + (i + 1) * ticks)
        for i, s in enumerate(symbols)
    ]


def aperture_off(face: np.ndarray, symbol: str) -> np.ndarray:
    """Return by how much the lips are farther apart than in a viseme, mm."""
    wanted = VOICE.gestures.viseme_targets[PHONE_NUMBER[symbol]].astype(float)
    return np.asarray(CONTRACT.features(face)[:, 0] - CONTRACT.features(wanted[None])[0, 0])


@pytest.mark.parametrize("noise", [0.3, 1.0])
def test_mouths_of_any_kind_close_and_stay_themselves(noise: float) -> None:
    line = line_of(WORDS)
    rng = np.random.default_rng(4)
    face = noise * rng.normal(size=(6 * len(WORDS) + 20, 7))
    kept = CONTRACT.kept(face, line, np.arange(len(face), dtype=float))
    for sounding in line:
        symbol, middle = PHONES[sounding.number], (sounding.start + sounding.end) // 2
        if symbol in "pbm":
            assert np.abs(aperture_off(kept[middle : middle + 1], symbol)).max() < 0.5
        rivals = [s for s in SHAPE_OF if SHAPE_OF.get(symbol) == SHAPE_OF[s]] or [symbol]
        away = [
            CONTRACT.apart(
                kept[middle : middle + 1],
                VOICE.gestures.viseme_targets[PHONE_NUMBER[rival]].astype(float),
            )[0]
            for rival in rivals
        ]
        assert rivals[int(np.argmin(away))] == symbol


def test_mouths_that_keep_their_word_are_left_alone() -> None:
    line = line_of(WORDS)
    ticks = np.array([(s.start + s.end) / 2 for s in line])
    visemes = VOICE.gestures.viseme_targets.astype(float)
    face = visemes[[s.number for s in line]]
    np.testing.assert_allclose(CONTRACT.kept(face, line, ticks), face, atol=1e-9)
    silent = np.random.default_rng(1).normal(size=(5, 7))
    np.testing.assert_array_equal(CONTRACT.kept(silent, line, np.arange(900.0, 905.0)), silent)
    np.testing.assert_array_equal(CONTRACT.kept(silent, [], np.arange(5.0)), silent)


def test_windows_do_not_matter() -> None:
    line, face = line_of(WORDS), np.random.default_rng(2).normal(size=(200, 7))
    ticks = np.arange(200.0)
    whole = CONTRACT.kept(face, line, ticks)
    parts = [CONTRACT.kept(face[i : i + 32], line, ticks[i : i + 32]) for i in range(0, 200, 32)]
    np.testing.assert_allclose(np.concatenate(parts), whole, atol=1e-12)


def test_a_receiver_closes_what_few_bits_leave_open() -> None:
    phones = tuple(Phone(s, 0.8 + 0.12 * i, 0.92 + 0.12 * i) for i, s in enumerate(WORDS))
    score = Score(phones, tuple(cue(phones)))
    rng = np.random.default_rng(3)
    params = np.tile(coding_for(VOICE).mean, (32 * 8, 1)) + 0.3 * rng.normal(size=(256, 1))
    motion = Motion(params.astype(np.float32), 50, 0.0, VOICE.layout, VOICE.identity, score)
    encoder = SuperframeEncoder(VOICE, l0_bytes=20, l1_bytes=7)
    frames = [encoder.encode(motion, k) for k in range(8)]
    open_mm = {}
    for lips in (False, True):
        decoder = SuperframeDecoder(VOICE, lips=lips)
        for frame in frames:
            decoder.push(frame.l0, frame.l1, frame.index)
        got = np.concatenate([decoder.render(k).params for k in range(8)]).astype(float)
        open_mm[lips] = [
            float(aperture_off(got[i : i + 1, :7], p.symbol)[0])
            for p in phones
            if p.symbol in "pbm" and (i := round(25 * (p.start + p.end))) < len(got)
        ]
    assert len(open_mm[True]) == 6
    assert np.abs(open_mm[True]).max() < 0.5
    assert np.abs(open_mm[False]).max() > 0.5
