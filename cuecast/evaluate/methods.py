"""Rules or units, and when the hand arrives: which makes the better cuer through the channel.

The same sentences are cued by each method, coded as in the sound of the standard profile, and
looked at before and after by a recogniser that has learned the targets of recordings.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.recognise import Recogniser
from codec.cuer.layout import N_FACE
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Key, Phone, Score
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from cuecast.dubbing.motions import ruled_motion
from synth.motion.rules.gesture import GestureSynthesiser
from synth.motion.rules.movement import ALIGNMENTS, plan_gestures
from synth.planning.scoring.text_score import score_of_text
from synth.units.concatenation.concatenation import ConcatenativeSynthesiser
from synth.units.recordings.recording import UnitRecording
from watermark.audio.signal.profile import find_profile
from watermark.link.superframe import SUPERFRAME_S

_BETWEEN_S = 1.5
"""Seconds between sentences."""


def recital(texts: Sequence[str]) -> Score:
    """Return the score of texts said one after the other."""
    phones: list[Phone] = []
    keys: list[Key] = []
    clock = 1.0
    for text in texts:
        score = score_of_text(text, start_s=clock)
        phones += score.phones
        keys += score.keys
        clock = score.phones[-1].end + _BETWEEN_S
    return Score(tuple(phones), tuple(keys))


def compare_methods(
    texts: Sequence[str], recordings: Sequence[UnitRecording], recogniser: Recogniser, voice: Voice
) -> list[dict[str, Any]]:
    """Return one row per method and alignment.

    Parameters
    ----------
    texts : sequence of str
    recordings : sequence of UnitRecording
        Where the units come from.
    recogniser : Recogniser
    voice : Voice
    """
    score = recital(texts)
    rows = []
    for alignment in ALIGNMENTS:
        units = ConcatenativeSynthesiser(recordings, voice, alignment=alignment)
        cuer = GestureSynthesiser(voice.name, alignment=alignment)
        for method, parts in (
            ("rules", ruled_motion([score], cuer, voice)),
            ("units", (part.motion for part in units.perform([score], start_s=0.0))),
        ):
            sent = _whole(parts, score)
            received = _through_standard(sent, voice)
            markers = [voice.reconstruct(params) for params in (sent.params, received)]
            squares = ((markers[0] - markers[1]).astype(np.float64) ** 2).sum(axis=2)
            rows.append(
                {
                    "method": method,
                    "alignment": alignment,
                    "marker_rms_mm": _rms(squares),
                    "hand_rms_mm": _rms(squares[:, N_FACE:]),
                    **_recognised("sent", markers[0], score, alignment, recogniser),
                    **_recognised("received", markers[1], score, alignment, recogniser),
                }
            )
    return rows


def _whole(parts: Iterable[Motion], score: Score) -> Motion:
    made = list(parts)
    params = np.concatenate([part.params for part in made])
    frames = round(SUPERFRAME_S * made[0].rate_hz)
    kept = params[: len(params) // frames * frames]
    return Motion(
        kept, made[0].rate_hz, 0.0, voice=made[0].voice, layout=made[0].layout, score=score
    )


def _through_standard(motion: Motion, voice: Voice) -> NDArray[np.float64]:
    """Return the parameters that a receiver of the sound draws if nothing is lost."""
    profile = find_profile("standard")
    encoder = SuperframeEncoder(voice, l0_bytes=profile.l0_bytes, l1_bytes=profile.l1_bytes)
    decoder = SuperframeDecoder(voice)
    count = round(motion.duration_s / SUPERFRAME_S)
    done = []
    for index in range(count):
        frame = encoder.encode(motion, index)
        decoder.push(frame.l0, frame.l1, index)
        if index > 0:
            done.append(decoder.render(index - 1).params)
    done.append(decoder.render(count - 1).params)
    return np.concatenate(done).astype(np.float64)


def _recognised(
    name: str, markers: NDArray[np.float32], score: Score, alignment: str, recogniser: Recogniser
) -> dict[str, float]:
    """Return the shares of shapes and placements that are recognised at their targets."""
    gestures = plan_gestures(score, alignment=alignment)
    at = np.rint(gestures.reach[1:] * 50).astype(np.int64)
    inside = at < len(markers)
    frames = markers[at[inside]]
    shape = recogniser.shape_posteriors(frames).argmax(1) == gestures.shape[1:][inside]
    placement = recogniser.placement_posteriors(frames).argmax(1) == gestures.placement[1:][inside]
    return {
        f"shapes_{name}": round(float(shape.mean()), 4),
        f"placements_{name}": round(float(placement.mean()), 4),
    }


def _rms(squares: NDArray[np.float64]) -> float:
    return round(float(np.sqrt(squares.mean())), 2)
