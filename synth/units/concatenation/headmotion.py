"""Head motion beyond single keys: it drifts, and marks the accents of speech.

Dikeys move the head as long as a key lasts; the paper asks for a separate suprasegmental part
(Gibert, Bailly, Elisei 2004, section 6). Here the slow part is taken out of the recordings, and
another one, made of the same means, follows the speech that is performed: the head rises with
the pitch at the end of a group that goes on or of a question, and nods where a sentence falls
(Munhall et al. 2004 measured how closely head and pitch go together). Everything is a function of
absolute time and of the accents nearby. Whatever is at the face follows the head.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from codec.cuer import layout
from codec.cuer.models.rigid import rotation_matrices
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENTS, Phone
from synth.motion.rules.drift import Drift, normals_at
from synth.motion.rules.gesture import FOLLOWS_HEAD
from synth.motion.rules.movement import LAWS, Gestures, moved
from synth.planning.prosody.melody import accents
from synth.units.recordings.recording import UnitRecording

FloatArray = NDArray[np.float64]

_SLOW_S = 0.6
"""Standard deviation of the Gaussian that separates slow motion from that of keys."""

_DRIFT_SHARE = 0.8
"""Share of the recorded head's deviation that drift gives."""

_DRIFT_BAND_HZ = (0.05, 0.5)
"""Band in Hz of the drift: slower than syllables."""

_NOD, _RISE = 1.6, -1.0
"""Turn of the head about its sideways axis at accents, in deviations of the recorded one."""

_SCATTER = 0.25
"""Standard deviation of a nod's size, of 1."""

_BEFORE_S, _BACK_S = 0.1, 0.7
"""Seconds from a nod's begin to its accent, and back."""

_TIPS = [layout.HAND_MARKERS.index(name) for name in (layout.FINGERS[1][-1], layout.FINGERS[2][-1])]
_FOLLOWS = np.array([FOLLOWS_HEAD[name] for name in PLACEMENTS])


class HeadMotion:
    """The suprasegmental motion of one speaker's head.

    Parameters
    ----------
    voice : Voice
    recordings : sequence of UnitRecording
        They show how far she turns her head.
    seed : int
        Of the drift and the scatter of accents.
    """

    def __init__(self, voice: Voice, recordings: Sequence[UnitRecording], *, seed: int = 0) -> None:
        self._voice = voice
        self._seed = seed
        self._head = [i for i, name in enumerate(voice.layout) if name.startswith("head.")]
        self._forearm = [i for i, name in enumerate(voice.layout) if name.startswith("forearm.")]
        self._head_inverse = np.linalg.pinv(voice.face.motion_directions.astype(np.float64))
        self._forearm_inverse = np.linalg.pinv(voice.hand.motion_directions.astype(np.float64))
        directions = voice.face.motion_directions.astype(np.float64)
        posture = np.mean([r.motion.params[:, self._head].mean(axis=0) for r in recordings], axis=0)
        self._slow = [
            (
                gaussian_filter1d(
                    r.motion.params[:, self._head].astype(np.float64),
                    _SLOW_S * r.motion.rate_hz,
                    axis=0,
                    mode="nearest",
                )
                - posture
            )
            @ directions
            for r in recordings
        ]
        slow = np.concatenate(self._slow)
        deviation = slow.std(axis=0)
        rng = np.random.default_rng([seed, 17])
        self._drift = Drift.seeded(_DRIFT_SHARE * deviation, rng, band_hz=_DRIFT_BAND_HZ)
        # The head turns about the neck, not about the middle of the face: what goes with a nod.
        self._nod = np.zeros(6)
        self._nod[0] = deviation[0]
        spread = max(float((slow[:, 0] ** 2).sum()), 1e-12)
        self._nod[3:] = deviation[0] * (slow[:, 3:] * slow[:, :1]).sum(axis=0) / spread

    def without_slow_part(self, recordings: Sequence[UnitRecording]) -> list[Motion]:
        """Return the motions of the recordings, their head's slow motion taken out."""
        motions = [recording.motion for recording in recordings]
        follows = [self._following(r.gestures, r.motion.times_s) for r in recordings]
        params = np.concatenate([motion.params for motion in motions]).astype(np.float64)
        still = self._turned(params, -np.concatenate(self._slow), np.concatenate(follows))
        ends = np.cumsum([len(motion.params) for motion in motions])[:-1]
        parts = np.split(still.astype(np.float32), ends)
        return [replace(m, params=part) for m, part in zip(motions, parts, strict=True)]

    def added(
        self, params: FloatArray, times: FloatArray, phones: Sequence[Phone], gestures: Gestures
    ) -> FloatArray:
        """Return frames with the motion of the head, and of the hand that follows it.

        Parameters
        ----------
        params : ndarray, shape (T, P)
        times : ndarray, shape (T,)
            Seconds on the programme's clock.
        phones : sequence of Phone
            The phones then and nearby.
        gestures : Gestures
            Where the hand is.
        """
        return self._turned(params, self.at(times, phones), self._following(gestures, times))

    def at(self, times: FloatArray, phones: Sequence[Phone]) -> FloatArray:
        """Return rotation vectors (rad) and shifts (mm) of the head, shape (T, 6)."""
        motion = self._drift.at(times)
        smooth = LAWS["minimum-jerk"]
        for accent in accents(phones):
            size = 1.0 + _SCATTER * float(normals_at(accent.start_s, 1, self._seed)[0])
            size *= _NOD if accent.falls else _RISE
            begin, end = accent.start_s - _BEFORE_S, accent.end_s
            up = smooth(np.clip((times - begin) / (end - begin), 0.0, 1.0))
            back = smooth(np.clip((times - end) / _BACK_S, 0.0, 1.0))
            motion += size * (up - back)[:, None] * self._nod
        return motion

    def _following(self, gestures: Gestures, times: FloatArray) -> FloatArray:
        """Return how much of the head's motion the hand takes over, 0..1, shape (T,)."""
        targets = _FOLLOWS[gestures.placement][:, None]
        here = moved(times, gestures, targets, LAWS["minimum-jerk"])
        return np.asarray(np.clip(here[:, 0], 0.0, 1.0))

    def _turned(self, params: FloatArray, motion: FloatArray, follows: FloatArray) -> FloatArray:
        """Return frames whose head has moved by `motion` more, the hand with it."""
        voice = self._voice
        tips = voice.hand.reconstruct(params[:, voice.hand_columns], _TIPS).mean(axis=1)
        lever = tips - voice.face.pivot
        turned = np.einsum("tij,tj->ti", rotation_matrices(motion[:, :3]), lever) - lever
        shift = np.zeros((len(params), 6))
        shift[:, 3:] = follows[:, None] * (turned + motion[:, 3:])
        result = params.copy()
        result[:, self._head] += motion @ self._head_inverse
        result[:, self._forearm] += shift @ self._forearm_inverse
        return result
