"""Recordings of a cuer: sound, labels and motion of one utterance, the source of all units."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cues.score import Score
from synth.motion.rules.movement import Gestures
from synth.units.speech.marks import PitchMarks, place_marks
from synth.units.speech.pitch import PitchTrack, track_pitch


@dataclass(frozen=True, slots=True)
class UnitRecording:
    """One utterance of a cuer.

    Attributes
    ----------
    sound : ndarray of float32, shape (n,)
        Speech, full scale 1; sample 0 stands at time 0.
    fs : int
        Sample rate in Hz.
    score : Score
        Phones and keys, on the same clock.
    gestures : Gestures
        When the hand leaves and reaches its targets, on the same clock.
    motion : Motion
        Parameters of face, hand, head and forearm over the whole utterance.
    track : PitchTrack
        Pitch of the sound.
    marks : PitchMarks
        Pitch marks of the sound.
    """

    sound: NDArray[np.float32]
    fs: int
    score: Score
    gestures: Gestures
    motion: Motion
    track: PitchTrack
    marks: PitchMarks

    @classmethod
    def analysed(
        cls,
        sound: NDArray[np.float32],
        fs: int,
        *,
        score: Score,
        gestures: Gestures,
        motion: Motion,
    ) -> "UnitRecording":
        """Make a recording, finding its pitch and pitch marks."""
        track = track_pitch(sound, fs)
        return cls(sound, fs, score, gestures, motion, track, place_marks(sound, fs, track))

    @property
    def duration_s(self) -> float:
        """Length of the sound in seconds."""
        return len(self.sound) / self.fs
