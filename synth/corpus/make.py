"""Making the three corpora: labelled C3D at 120 Hz, sound and TextGrid of every utterance.

A folder of corpora holds ``corpus1/``, ``corpus2/`` and ``corpus3/`` with one file of each kind
per utterance, and ``corpus.json``: who performed, the texts, and how they cover French. Any C3D
with the same marker names, with a TextGrid beside it, can take their place.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import soundfile
from numpy.typing import NDArray

from codec.cuer.c3d import read_c3d, write_c3d
from codec.cues.cueing import cue
from codec.cues.phonology import CONSONANTS, PAUSE, VOWELS
from codec.cues.score import Score
from synth.corpus.capture import record
from synth.corpus.scores import shape_transitions
from synth.corpus.studio import Studio, surround
from synth.recordings.choice import Coverage
from synth.recordings.rendered import line_of
from synth.recordings.sentences import N_SENTENCES, choose_sentences
from synth.rules.gesture import GestureSynthesiser
from synth.scoring.textgrid import read_textgrid, write_textgrid
from synth.speech.espeak_voice import render
from synth.text.espeak import RATE_HZ

RATE_OF_CORPORA_HZ = 120.0
"""Frames per second, as in the paper (section 2)."""

ROUNDS_OF_SHAPES = 8
"""How often corpus 1 goes through all transitions: folded fingers need many examples."""

_LEAD_S = 0.8
"""Seconds of silence before a line, in which the hand comes up."""

_WORDS_PER_MINUTE = 80  # cueing slows speech down: Attina 2005 measured 2.5 to 4 syllables/s


@dataclass(frozen=True, slots=True)
class Utterance:
    """What one file of a corpus holds.

    Attributes
    ----------
    name : str
        Folder and file name without ending, as ``corpus3/s001``.
    text : str
        What is written; empty for corpora 1 and 2.
    line : tuple of str
        Its phones, pauses as `codec.cues.phonology.PAUSE`; empty for corpus 1.
    seed : int
        Of the cuer's small motions and the studio's faults.
    """

    name: str
    text: str
    line: tuple[str, ...]
    seed: int


@dataclass(frozen=True, slots=True)
class Session:
    """Who performs and who records.

    Attributes
    ----------
    out : Path
        Folder of the corpora.
    identity, law : str
        As for `GestureSynthesiser`.
    rate_hz : float
    studio : Studio
        For corpora 2 and 3; corpus 1 has the same faults and cameras all around.
    """

    out: Path
    identity: str = "claire"
    law: str = "minimum-jerk"
    rate_hz: float = RATE_OF_CORPORA_HZ
    studio: Studio = field(default_factory=Studio)


def plan_corpora(
    sentences: Sequence[str], *, count: int = N_SENTENCES, seed: int = 0
) -> tuple[list[Utterance], list[Coverage]]:
    """Return all utterances of the corpora, and the coverage report of corpus 3."""
    chosen, report = choose_sentences(sentences, count)
    utterances = [Utterance("corpus1/shapes", "", (), seed)]
    utterances += [
        Utterance(f"corpus2/{name}", "", tuple(line), seed + 1) for name, line in _sounds()
    ]
    utterances += [
        Utterance(f"corpus3/s{number:03d}", text, tuple(line_of(text)), seed + 100 + number)
        for number, text in enumerate(chosen, start=1)
    ]
    return utterances, report


def _sounds() -> Iterator[tuple[str, list[str]]]:
    """Yield corpus 2: isolated vowels, and every consonant between a, i and u."""
    yield "vowels", [symbol for vowel in VOWELS for symbol in (vowel, PAUSE)]
    for vowel in ("a", "i", "u"):
        yield (
            f"vcv_{vowel}",
            [s for c in CONSONANTS for s in (vowel, c, vowel, PAUSE)],
        )


def make_corpora(
    session: Session,
    utterances: Sequence[Utterance],
    *,
    jobs: int = 1,
    advance: Callable[[], object] = lambda: None,
) -> None:
    """Perform, record and write all `utterances`.

    Parameters
    ----------
    session : Session
    utterances : sequence of Utterance
    jobs : int
        Processes at work.
    advance : callable
        Called once per finished utterance, for a progress bar.
    """
    for folder in {Path(u.name).parent for u in utterances}:
        (session.out / folder).mkdir(parents=True, exist_ok=True)
    if jobs == 1:
        for utterance in utterances:
            make_utterance(session, utterance)
            advance()
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for _ in pool.map(make_utterance, [session] * len(utterances), utterances):
            advance()


def make_utterance(session: Session, utterance: Utterance) -> None:
    """Perform, record and write one utterance."""
    free = not utterance.line
    cuer = _cuer(session.identity, session.law, session.rate_hz, utterance.seed, free)
    stem = session.out / utterance.name
    studio = session.studio
    if free:
        score = shape_transitions(rounds=ROUNDS_OF_SHAPES)
        studio = Studio(
            surround(), noise_mm=studio.noise_mm, bias_mm=studio.bias_mm,
            dropouts_per_s=studio.dropouts_per_s, swaps_per_s=studio.swaps_per_s,
            ghosts_per_s=studio.ghosts_per_s,
        )  # fmt: skip
    else:
        samples, score = spoken(utterance)
        soundfile.write(stem.with_suffix(".wav"), samples, RATE_HZ, subtype="PCM_16")
    recording = record(cuer, score, studio=studio, seed=utterance.seed)
    write_c3d(
        stem.with_suffix(".c3d"), recording.observed, rate_hz=session.rate_hz,
        ghosts=recording.ghosts,
    )  # fmt: skip
    duration_s = len(recording.observed) / session.rate_hz
    write_textgrid(stem.with_suffix(".TextGrid"), score, duration_s)


def spoken(utterance: Utterance) -> tuple[NDArray[np.float32], Score]:
    """Return sound and score of an utterance; in corpus 2 nothing is cued."""
    rendering = render(utterance.line, words_per_minute=_WORDS_PER_MINUTE)
    silence = np.zeros(round(_LEAD_S * RATE_HZ), dtype=np.float32)
    keys = () if utterance.name.startswith("corpus2") else tuple(cue(rendering.phones))
    score = Score(rendering.phones, keys).shifted(len(silence) / RATE_HZ)
    return np.concatenate([silence, rendering.samples]), score


@cache
def _cuer(identity: str, law: str, rate_hz: float, seed: int, free: bool) -> GestureSynthesiser:
    return GestureSynthesiser(identity, law=law, rate_hz=rate_hz, seed=seed, free_space=free)


def write_manifest(
    session: Session, utterances: Sequence[Utterance], report: Sequence[Coverage]
) -> None:
    """Write ``corpus.json``."""
    manifest = {
        "identity": session.identity,
        "law": session.law,
        "rate_hz": session.rate_hz,
        "noise_mm": session.studio.noise_mm,
        "bias_mm": session.studio.bias_mm,
        "coverage": [asdict(part) for part in report],
        "utterances": [
            {"name": u.name, "text": u.text, "phones": " ".join(u.line)} for u in utterances
        ],
    }
    text = json.dumps(manifest, ensure_ascii=False, indent=1)
    (session.out / "corpus.json").write_text(text + "\n", encoding="utf-8")


def read_utterance(path: Path) -> tuple[NDArray[np.float32], float, Score]:
    """Read a C3D and the TextGrid beside it.

    Returns
    -------
    markers : ndarray of float32, shape (T, 113, 3)
        Millimetres; NaN where hidden.
    rate_hz : float
    score : Score
        On the clock of the first frame.
    """
    markers, rate_hz, start_s = read_c3d(path)
    return markers, rate_hz, read_textgrid(path.with_suffix(".TextGrid")).shifted(-start_s)
