"""The second and third leg of every figure: the other virtual cuer, and real ones.

A cuer by rule moves by the equations that the codec predicts with; what holds for her alone proves
little. The second virtual cuer shares none of them. Real cuers come from a folder that the user
names: tables of landmarks, one utterance each, with ``phones.csv`` (columns ``utterance`` and
``phones``) beside them where it is known what was said. Both reach the codec as an interpreter
would: through a film and `synth.capture`.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Score
from codec.errors import CueError
from cuecast.evaluate.films import as_rows, film
from synth.capture.capture import capture
from synth.capture.options import CaptureOptions
from synth.measured.cuer import MEASURED, performer
from synth.measured.plan import paced
from synth.training.build_coding import recital

SECOND = f"solange/{MEASURED}"
"""Name of the second virtual cuer."""

PHONES = "phones.csv"

_CAMERA_HZ = 30.0
"""Frames per second of the film."""

_NOISE_MM = 3.0
"""Standard deviation in mm of the hand's landmarks."""

_TAIL_S = 1.0
"""Seconds after the last phone, in which the hand comes to rest."""


def second_cuer(voice: Voice, texts: Sequence[str], folder: Path, *, seed: int = 0) -> Motion:
    """Return the second virtual cuer's film of some texts, captured into a voice.

    Parameters
    ----------
    voice : Voice
    texts : sequence of str
        Said one after the other, at her pace.
    folder : Path
        For the film's landmarks.
    seed : int

    Returns
    -------
    Motion
        With the score that she performed.
    """
    score = paced(recital(texts, seed=seed))
    path = folder / f"second-{seed}.csv"
    filmed_as_csv(SECOND, score, path, seed=seed)
    found = capture(path, voice, CaptureOptions(score=score))
    return found.motion


def filmed_as_csv(
    cuer: str, score: Score, path: Path, *, seed: int = 0, noise_mm: float = _NOISE_MM
) -> None:
    """Write the landmarks of a film of a virtual cuer, ``identity/law``, as a table."""
    identity, law = cuer.split("/")
    actor = performer(identity, law, rate_hz=_CAMERA_HZ, seed=seed)
    seconds = (score.phones[-1].end if score.phones else 0.0) + _TAIL_S
    face, hand, _ = film(actor, score, seconds=seconds, noise_mm=noise_mm, seed=seed)
    path.write_text(as_rows(face, hand, _CAMERA_HZ), encoding="utf-8")


def real_utterances(
    folder: Path, voice: Voice, options: CaptureOptions | None = None
) -> Iterator[tuple[str, Motion]]:
    """Yield the captured utterances of a folder of real cuers with their names.

    Parameters
    ----------
    folder : Path
        Of landmark tables; ``phones.csv`` beside them is no utterance.
    voice : Voice
    options : CaptureOptions, optional
        For all of them: aspect and frame rate of their camera.

    Raises
    ------
    CueError
        If there is none.
    """
    paths = sorted(path for path in folder.glob("*.csv") if path.name != PHONES)
    if not paths:
        raise CueError(f"{folder}: no tables of landmarks (*.csv)")
    for path in paths:
        yield path.stem, capture(path, voice, options or CaptureOptions()).motion
