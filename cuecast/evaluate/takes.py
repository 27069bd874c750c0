"""Material for the evaluation of the models: recorded utterances, one after another.

The built-in material is performed by the virtual cuer on the spot, so that the truth of hidden
markers is known. A folder of corpora (C3D with TextGrid, `synth.studio.corpora`) takes its place;
there hidden markers are unknown.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from codec.cuer.c3d import read_c3d
from codec.cues.score import Key, Score
from codec.errors import CueError
from synth.capture.points.framing import Framing, find_framing
from synth.language.text.espeak import RATE_HZ
from synth.language.text.sentences import read_sentences
from synth.motion.measured.cuer import MEASURED, performer
from synth.motion.measured.plan import paced
from synth.planning.scoring.drills import shape_transitions
from synth.studio.corpora import (
    RATE_OF_CORPORA_HZ,
    ROUNDS_OF_SHAPES,
    Utterance,
    plan_corpora,
    read_utterance,
    spoken,
)
from synth.studio.studio import Studio, surround
from synth.studio.take import record

_FRAMING_TAKES = 3
"""Takes that the axes of a laboratory are found from."""


@dataclass(frozen=True, slots=True)
class EvaluatedTake:
    """One recorded utterance.

    Attributes
    ----------
    name : str
    rate_hz : float
    observed : ndarray of float32, shape (T, 113, 3)
        Millimetres; NaN where hidden.
    truth : ndarray of float32, shape (T, 113, 3), or None
        Where the markers were, if known.
    score : Score
        On the clock of the first frame.
    sound : ndarray of float32, shape (n,), or None
    fs : int
        Of the sound, Hz.
    targets : tuple of (Key or None, float), or None
        When the hand reached each key, or rest, in seconds; None if nobody knows.
    """

    name: str
    rate_hz: float
    observed: NDArray[np.float32]
    truth: NDArray[np.float32] | None
    score: Score
    sound: NDArray[np.float32] | None
    fs: int
    targets: tuple[tuple[Key | None, float], ...] | None


@dataclass(frozen=True, slots=True)
class Performed:
    """Corpora performed by the virtual cuer.

    Attributes
    ----------
    identity, law : str
        As for `synth.motion.measured.cuer.performer`.
    utterances : tuple of Utterance
    """

    identity: str = "claire"
    law: str = "minimum-jerk"
    utterances: tuple[Utterance, ...] = ()

    def __str__(self) -> str:
        """Return the material of the figures."""
        return f"virtual cuer {self.identity}, {self.law}, 12 cameras, 120 Hz"

    def takes(self, corpus: int) -> Iterator[EvaluatedTake]:
        """Yield the utterances of corpus 1, 2 or 3 in order."""
        for utterance in self.utterances:
            if utterance.name.startswith(f"corpus{corpus}/"):
                yield self._take(utterance)

    def _take(self, utterance: Utterance) -> EvaluatedTake:
        free = not utterance.line
        sound, score = (
            (None, shape_transitions(rounds=ROUNDS_OF_SHAPES)) if free else spoken(utterance)
        )
        cuer = performer(
            self.identity,
            self.law,
            rate_hz=RATE_OF_CORPORA_HZ,
            seed=utterance.seed,
            free_space=free,
        )
        if self.law == MEASURED:
            sound, score = None, paced(score)
        studio = Studio(surround()) if free else Studio()
        made = record(cuer, score, studio=studio, seed=utterance.seed)
        reached = tuple(cuer.target_times(score))
        return EvaluatedTake(
            utterance.name, cuer.rate_hz, made.observed, made.truth, score, sound, RATE_HZ, reached
        )


def performed(*, identity: str = "claire", law: str = "minimum-jerk") -> Performed:
    """Return the three corpora of a virtual cuer, performed when they are asked for."""
    return Performed(identity, law, tuple(plan_corpora(read_sentences())[0]))


@dataclass(frozen=True, slots=True)
class Recorded:
    """Corpora in a folder: ``corpus1/`` to ``corpus3/`` with C3D, TextGrid and WAV.

    Axes and the cueing hand are found from the first sentences of corpus 3.
    """

    folder: Path

    def __str__(self) -> str:
        """Return the material of the figures."""
        return f"recordings in {self.folder.name}"

    def takes(self, corpus: int) -> Iterator[EvaluatedTake]:
        """Yield the utterances of corpus 1, 2 or 3 in order of their names.

        Raises
        ------
        CueError
            If there are none.
        """
        framing = self._framing()
        for path in self._paths(corpus):
            observed, rate_hz, score = read_utterance(path)
            observed = framing.apply(observed)
            sound, fs = None, RATE_HZ
            if path.with_suffix(".wav").exists():
                sound, fs = soundfile.read(path.with_suffix(".wav"), dtype="float32")
            yield EvaluatedTake(path.stem, rate_hz, observed, None, score, sound, fs, None)

    @property
    def sentences(self) -> int:
        """Number of utterances of corpus 3."""
        return len(self._paths(3))

    def _paths(self, corpus: int) -> list[Path]:
        paths = sorted((self.folder / f"corpus{corpus}").glob("*.c3d"))
        if not paths:
            raise CueError(f"{self.folder}: no C3D files in corpus{corpus}")
        return paths

    def _framing(self) -> Framing:
        first = self._paths(3)[:_FRAMING_TAKES]
        try:
            return find_framing(np.concatenate([read_c3d(path)[0] for path in first]))
        except CueError as error:
            raise CueError(f"{first[0].parent}: {error}") from error


Material = Performed | Recorded
