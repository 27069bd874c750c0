"""Recordings of a cuer: sound, labels and motion of one utterance, the source of all units."""

import functools
import io
from dataclasses import dataclass

import numpy as np
import soundfile
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cues.score import Phone, Score
from codec.errors import CueError
from synth.motion.rules.movement import Gestures
from synth.units.speech.lsp import line_spectrum_pairs, linear_prediction
from synth.units.speech.marks import PitchMarks, place_marks
from synth.units.speech.pitch import PitchTrack, track_pitch

LSP_ORDER = 16
"""Line spectrum pairs of a phone's middle: enough for the formants up to 8 kHz."""

_LSP_FRAME_S = 0.025
"""Length of a frame in seconds: two periods of a low voice."""

_SILENCE_DB = -80.0
"""Least level of a phone's middle."""

_KEPT = 256
"""Packed sounds that stay unpacked: those of a few sentences."""


@dataclass(frozen=True, slots=True, eq=False)
class PackedSound:
    """A sound as the bytes of a small file, unpacked when it is needed.

    Attributes
    ----------
    data : bytes
        FLAC, or Ogg with Opus.
    length : int
        Samples.
    """

    data: bytes
    length: int


@functools.lru_cache(maxsize=_KEPT)
def _unpacked(packed: PackedSound) -> NDArray[np.float32]:
    try:
        sound, _ = soundfile.read(io.BytesIO(packed.data), dtype="float32")
    except soundfile.SoundFileError as error:
        raise CueError(f"damaged recordings: a sound cannot be read: {error}") from error
    if sound.shape != (packed.length,):
        raise CueError(f"damaged recordings: a sound of {len(sound)} samples, not {packed.length}")
    return np.asarray(sound, dtype=np.float32)


@dataclass(frozen=True, slots=True)
class UnitRecording:
    """One utterance of a cuer.

    Attributes
    ----------
    source : ndarray of float32, shape (n,), or PackedSound
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
    middles : ndarray of float32, shape (phones, LSP_ORDER + 1)
        Line spectrum pairs (rad) and level (dB) of the sound in the middle of each phone.
    fits : ndarray of float32, shape (phones,)
        Logarithm of the likelihood of each phone in its sound, 0 where its label is certain.
    """

    source: NDArray[np.float32] | PackedSound
    fs: int
    score: Score
    gestures: Gestures
    motion: Motion
    track: PitchTrack
    marks: PitchMarks
    middles: NDArray[np.float32]
    fits: NDArray[np.float32]

    @classmethod
    def analysed(
        cls,
        sound: NDArray[np.float32],
        fs: int,
        *,
        score: Score,
        gestures: Gestures,
        motion: Motion,
        fits: NDArray[np.float32] | None = None,
    ) -> "UnitRecording":
        """Make a recording with its pitch and pitch marks; without `fits` labels are certain."""
        track = track_pitch(sound, fs)
        marks = place_marks(sound, fs, track)
        middles = _middles(sound, fs, score.phones)
        if fits is None:
            fits = np.zeros(len(score.phones), dtype=np.float32)
        return cls(sound, fs, score, gestures, motion, track, marks, middles, fits)

    @property
    def sound(self) -> NDArray[np.float32]:
        """The speech, shape (n,)."""
        return _unpacked(self.source) if isinstance(self.source, PackedSound) else self.source

    @property
    def samples(self) -> int:
        """Length of the sound in samples."""
        return self.source.length if isinstance(self.source, PackedSound) else len(self.source)

    @property
    def duration_s(self) -> float:
        """Length of the sound in seconds."""
        return self.samples / self.fs


def _middles(sound: NDArray[np.float32], fs: int, phones: tuple[Phone, ...]) -> NDArray[np.float32]:
    """Return line spectrum pairs and level around the middles of phones."""
    width = round(_LSP_FRAME_S * fs)
    padded = np.pad(sound.astype(np.float64), width)
    first = np.array([round((p.start + p.end) / 2 * fs) for p in phones], dtype=np.int64)
    first = np.clip(first + width - width // 2, 0, len(padded) - width)
    frames = padded[first[:, None] + np.arange(width)] * np.hanning(width)
    pairs = line_spectrum_pairs(linear_prediction(frames, LSP_ORDER))
    power = np.maximum((frames**2).mean(axis=1), 10 ** (_SILENCE_DB / 10))
    return np.column_stack([pairs, 10 * np.log10(power)]).astype(np.float32)
