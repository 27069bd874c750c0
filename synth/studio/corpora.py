"""Utterances of the paper's three corpora: what each says, how it sounds, reading it back.

Corpus 1 has the hand's shapes in free space, corpus 2 sounds, corpus 3 cued sentences. One
utterance is one C3D file with a TextGrid beside it; `lab.corpora` writes them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cuer.c3d import read_c3d
from codec.cues.cueing import cue
from codec.cues.phonology import CONSONANTS, PAUSE, VOWELS
from codec.cues.score import Score
from synth.language.text.espeak import RATE_HZ
from synth.planning.scoring.textgrid import read_textgrid
from synth.units.recordings.choice import SentenceCoverage
from synth.units.recordings.rendered import line_of
from synth.units.recordings.sentences import N_SENTENCES, choose_sentences
from synth.units.speech.espeak_voice import render

RATE_OF_CORPORA_HZ = 120.0
"""Frames per second, as in the paper (section 2)."""

ROUNDS_OF_SHAPES = 8
"""How often corpus 1 goes through all transitions: folded fingers need many examples."""

_LEAD_S = 0.8
"""Seconds of silence before a line: the hand comes up."""

_WORDS_PER_MINUTE = 80  # cueing slows speech down: Attina 2005 measured 2.5 to 4 syllables/s


@dataclass(frozen=True, slots=True)
class Utterance:
    """What one file of a corpus holds.

    Attributes
    ----------
    name : str
        Folder and file name without ending, as ``corpus3/s001``.
    text : str
        The written text; empty for corpora 1 and 2.
    line : tuple of str
        Its phones, pauses as `codec.cues.phonology.PAUSE`; empty for corpus 1.
    seed : int
        Of the cuer's small motions and the studio's faults.
    """

    name: str
    text: str
    line: tuple[str, ...]
    seed: int


def plan_corpora(
    sentences: Sequence[str], *, count: int = N_SENTENCES, seed: int = 0
) -> tuple[list[Utterance], list[SentenceCoverage]]:
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
        yield (f"vcv_{vowel}", [s for c in CONSONANTS for s in (vowel, c, vowel, PAUSE)])


def spoken(utterance: Utterance) -> tuple[NDArray[np.float32], Score]:
    """Return sound and score of an utterance; in corpus 2 nothing is cued."""
    rendering = render(utterance.line, words_per_minute=_WORDS_PER_MINUTE)
    silence = np.zeros(round(_LEAD_S * RATE_HZ), dtype=np.float32)
    keys = () if utterance.name.startswith("corpus2") else tuple(cue(rendering.phones))
    score = Score(rendering.phones, keys).shifted(len(silence) / RATE_HZ)
    return np.concatenate([silence, rendering.samples]), score


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
