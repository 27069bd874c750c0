"""The hand that is shown is never too fast, and the same whatever the pieces."""

import numpy as np
import pytest

from codec.analysis.readability import peak_speed
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from cuecast.dubbing.motions import SynthesisedMotion
from receiver.reception.assemble import Assembler
from receiver.reception.slew_rate import FASTEST_M_S, SlewRateLimiter
from receiver.reception.tracking import RATE_HZ, TimelineTracker
from synth.planning.scoring.text_score import score_of_text


@pytest.fixture(scope="module")
def voice() -> Voice:
    return load_voice()


@pytest.fixture(scope="module")
def stroke(voice: Voice) -> np.ndarray:
    """A hand that rises to the chin within a tenth of a second."""
    source = SynthesisedMotion(score_of_text("Chou !", start_s=1.0), voice)
    slow = source.window(0.0, 96).params
    at = np.interp(np.arange(60), [0, 24, 29, 59], [0, 30, 52, 80])
    return np.asarray(slow[np.round(at).astype(int)])


def test_fast_strokes_catch_up(voice: Voice, stroke: np.ndarray) -> None:
    calmed = SlewRateLimiter(voice, RATE_HZ).calmed(stroke)
    fast, now = (peak_speed(voice.reconstruct(x), RATE_HZ) for x in (stroke, calmed))
    assert fast > 2.0
    assert now < FASTEST_M_S + 0.01
    face = [c for c in range(stroke.shape[1]) if c not in voice.hand_columns]
    np.testing.assert_array_equal(calmed[:, face], stroke[:, face])
    np.testing.assert_allclose(calmed[-20:], stroke[-20:], atol=1e-6)


def test_slow_frames_stay_to_the_bit(voice: Voice, stroke: np.ndarray) -> None:
    slow = np.repeat(stroke, 6, axis=0)[:90]
    smooth = np.apply_along_axis(lambda x: np.convolve(x, np.ones(24) / 24, "same"), 0, slow)
    smooth = smooth[24:-24].astype(np.float32)
    assert SlewRateLimiter(voice, RATE_HZ).calmed(smooth) is smooth


@pytest.mark.parametrize("cut", [24, 27, 29])
def test_pieces_go_on_where_the_one_before_ended(
    voice: Voice, stroke: np.ndarray, cut: int
) -> None:
    calm = SlewRateLimiter(voice, RATE_HZ)
    first = calm.calmed(stroke[:cut])
    parts = np.concatenate([first, calm.calmed(stroke[cut:], first[-1])])
    np.testing.assert_allclose(parts, calm.calmed(stroke), atol=1e-5)


def test_a_splice_is_not_a_stroke(voice: Voice, stroke: np.ndarray) -> None:
    cut = np.concatenate([stroke[:2], stroke[-2:]])
    np.testing.assert_array_equal(SlewRateLimiter(voice, RATE_HZ).calmed(cut), cut)


@pytest.mark.parametrize("shown", [True, False])
def test_what_is_shown_is_calm_across_superframes(
    shown: bool, voice: Voice, stroke: np.ndarray
) -> None:
    """What is kept is the decoder's."""
    there_and_back = np.concatenate([stroke, stroke[::-1]])
    params = np.concatenate([there_and_back, there_and_back[:8], there_and_back])[:192]
    sent = Motion(params, RATE_HZ, 0.0, voice.layout, voice.identity, None)
    encoder, bare = SuperframeEncoder(voice, l0_bytes=80, l1_bytes=80), SuperframeDecoder(voice)
    tracker, assembler, drawn = TimelineTracker(voice, calm=shown), Assembler(voice), []
    for index in range(6):
        frame = encoder.encode(sent, index)
        drawn.append(bare.push(frame.l0, frame.l1, index).params)
        for event in tracker.take(frame.l0, frame.l1, 0.64 * index - 1.28):
            assembler.add(event)
    received = assembler.motion().params
    assert peak_speed(voice.reconstruct(np.concatenate(drawn)), RATE_HZ) > 1.6
    peak = peak_speed(voice.reconstruct(received), RATE_HZ)
    assert peak < FASTEST_M_S + 0.01 if shown else peak > 1.6
