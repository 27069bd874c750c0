"""A speaker's models, and how her parameters become those of the voice.

Shapes of face and hand are the same numbers for both. The forearm is not: hands differ in length
and faces in proportions, and what counts in cueing is where the longest finger points.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.models.face import N_FACE_PARAMETERS, FaceModel
from codec.cuer.models.hand import HandModel
from codec.cuer.voice import Voice
from synth.capture.points.place import NO_CONTACT, Contact

FloatArray = NDArray[np.float64]

_TIPS = [layout.HAND_MARKERS.index(name) for name in ("F2T", "F3T")]
_WRIST = [layout.HAND_MARKERS.index(name) for name in layout.WRIST]

_LONGEST_MM = 8.0
"""Difference of length in mm over which a finger counts less and less as the longest."""

_SCALE = np.array([100.0] * 3 + [1.0] * 3)
"""Rotations count by the way they move a hand."""


@dataclass(frozen=True, slots=True)
class Speaker:
    """Models of one speaker whose parameters are those of a voice.

    Attributes
    ----------
    voice : Voice
    face : FaceModel
    hand : HandModel
    contact : Contact
        How her face lies against the voice's.
    hand_size : float
        Against the voice's, after the head has been brought to the voice's size.
    face_offset_mm, hand_offset_mm : float
        Mean displacement of the markers that was found.
    """

    voice: Voice
    face: FaceModel
    hand: HandModel
    contact: Contact = NO_CONTACT
    hand_size: float = 1.0
    face_offset_mm: float = 0.0
    hand_offset_mm: float = 0.0

    def to_voice(self, hand: FloatArray, face: FloatArray) -> FloatArray:
        """Return hand parameters that make the voice point where the speaker does.

        Parameters
        ----------
        hand : ndarray of float64, shape (T, naH + nmH)
            Of the speaker's model.
        face : ndarray of float64, shape (T, 7 + nmF)
            Of the same frames: placements move with the head.
        """
        if self.hand is self.voice.hand and not len(self.contact.at):
            return hand
        own, others = self.hand.reconstruct(hand), self.voice.hand.reconstruct(hand)
        # What touches the face is the longest finger; which one that is changes smoothly.
        length = np.linalg.norm(others[:, _TIPS] - others[:, _WRIST].mean(1)[:, None], axis=-1)
        share = np.exp((length - length.max(1, keepdims=True)) / _LONGEST_MM)
        share = (share / share.sum(1, keepdims=True))[..., None]
        tip, voices_tip = ((share * markers[:, _TIPS]).sum(1) for markers in (own, others))
        return moved_by(self.voice.hand, hand, tip + self._contact(tip, face) - voices_tip)

    def _contact(self, tip: FloatArray, face: FloatArray) -> FloatArray:
        """Return how far the tip (T, 3) moves because the voice's face lies elsewhere."""
        motion = self.face.motion(face[:, N_FACE_PARAMETERS:])
        still = rigid.inverse_rigid_motion((tip - self.face.pivot)[:, None], motion)[:, 0]
        shift = self.contact.to_voice(still + self.face.pivot)
        turn = rigid.rotation_matrices(motion[:, :3])
        return np.asarray(np.einsum("tij,tj->ti", turn, shift))


def moved_by(model: HandModel, hand: FloatArray, shift: FloatArray) -> FloatArray:
    """Return hand parameters (T, naH + nmH) moved by `shift` (T, 3), mm, as far as they can."""
    directions = model.motion_directions.astype(np.float64)
    wanted = np.concatenate([np.zeros_like(shift), shift], axis=1)
    out = hand.copy()
    out[:, model.n_shape :] += (wanted * _SCALE) @ np.linalg.pinv(directions * _SCALE)
    return out
