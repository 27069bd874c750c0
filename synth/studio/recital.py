"""Recitals of the virtual cuer: sentences performed exactly and imprecisely, at several paces.

`cuecast voice build` trains coding tables on them; `cuecast evaluate` measures on the sentences
that are kept from training.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import resources

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import N_FACE, N_HAND
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import cue
from codec.cues.score import Phone, Score
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.scoring.text_score import score_of_text

PAUSES_S = (0.3, 0.6, 1.2, 2.0)
"""Silences between sentences."""

PACES = (0.85, 1.25, 1.6)
"""Factors on the lengths of phones in further scores for the format's tables."""

HELD_OUT_EVERY = 8
"""Sentences among which one is kept from training, for `cuecast evaluate codec`."""

_UNEVENNESS = 0.4
"""Standard deviation of the logarithm of a phone's length about its prediction, read speech."""

TAIL_S = 1.5
"""Seconds after the last phone: the hand comes to rest."""

N_FACE_PARAMS = 7
"""Parameters of the face, which come first."""

_BOUNDARY_S = 0.03
"""Standard deviation in seconds of a cuer's phone boundaries against the sound's."""

_LEAD_DRIFT_S = 0.03
"""Amplitude in seconds of each wave of a cuer's lead or lag."""

_DRIFT_PERIODS_S = (3.1, 7.3)
"""Periods in seconds of these waves; they have no common multiple nearby."""

_LEAST_S = 0.02
"""Seconds that a phone keeps at least: a tick."""

_NOISE_MM = 0.5
"""Standard deviation in mm of the markers' noise in the loose performances."""

_HIDDEN_SHARE = 0.1
"""Share of the hand's markers that are hidden at a time."""

_HIDDEN_FRAMES = 15
"""Of imprecise performances: errors of sounds' boundaries (standard deviation) and of the hand's
lead (two slow waves), noise of markers, share of hidden ones and for how many frames."""


def sentences(*, held_out: bool = False) -> list[str]:
    """Return the sentences that come with the package for training, or those kept from it."""
    text = resources.files("synth").joinpath("assets/sentences.txt").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [line for i, line in enumerate(lines) if (i % HELD_OUT_EVERY == 0) == held_out]


def recital(texts: Sequence[str], *, seed: int = 0, start_s: float = 1.0) -> Score:
    """Return the score of texts one after another, with silences of all lengths between them."""
    rng = np.random.default_rng([seed, 71])
    score = Score((), ())
    for text in texts:
        more = score_of_text(text, start_s=start_s)
        score = Score(score.phones + more.phones, score.keys + more.keys)
        if more.phones:
            start_s = round(more.phones[-1].end + float(rng.choice(PAUSES_S)), 2)
    return score


def perform(voice: Voice, score: Score, *, seed: int = 0, law: str = "minimum-jerk") -> Motion:
    """Return the motion of the voice's cuer performing a score, at 50 Hz from time 0."""
    cuer = GestureSynthesiser(voice.name, law=law, seed=seed)
    return cuer.motion(score, 0.0, int(50 * (score.phones[-1].end + TAIL_S)), voice)


def imprecise(voice: Voice, score: Score, *, seed: int = 0, law: str = "minimum-jerk") -> Motion:
    """Return a performance that keeps to its score less well, as a recorded cuer's does.

    Face and hand each follow sounds whose boundaries lie elsewhere than the score says (labels of
    recordings are not exact, and cuers are not), the hand besides earlier or later for seconds on
    end; the markers are seen with noise, those of the hand hidden at times.

    Parameters
    ----------
    voice : Voice
    score : Score
        The score that the motion carries.
    seed, law
        As for `synth.motion.rules.gesture.GestureSynthesiser`.
    """
    rng = np.random.default_rng([seed, 73])
    cuer = GestureSynthesiser(voice.name, law=law, seed=seed)
    n_frames = int(50 * (score.phones[-1].end + TAIL_S))
    face, hand = (
        _seen(voice, cuer.markers(_misplaced(score, rng, drift_s), 0.0, n_frames), rng)
        for drift_s in (0.0, _LEAD_DRIFT_S)
    )
    params = np.concatenate([face.params[:, :N_FACE_PARAMS], hand.params[:, N_FACE_PARAMS:]], 1)
    return replace(hand, params=params, score=score)


def _misplaced(score: Score, rng: np.random.Generator, drift_s: float) -> Score:
    """Return a score whose sounds begin and end elsewhere."""
    times = np.unique([edge for phone in score.phones for edge in (phone.start, phone.end)])
    phase = rng.uniform(0, 2 * np.pi, len(_DRIFT_PERIODS_S))
    drift = np.sin(np.divide.outer(2 * np.pi * times, _DRIFT_PERIODS_S) + phase).sum(axis=1)
    moved = times + _BOUNDARY_S * rng.normal(size=times.size) + drift_s * drift
    for i in range(1, len(moved)):
        moved[i] = max(moved[i], moved[i - 1] + _LEAST_S)
    at = dict(zip(times.tolist(), moved.tolist(), strict=True))
    phones = tuple(Phone(p.symbol, at[p.start], at[p.end]) for p in score.phones)
    return Score(phones, tuple(cue(phones)))


def _seen(voice: Voice, markers: NDArray[np.float32], rng: np.random.Generator) -> Motion:
    """Return the motion that a voice finds for noisy markers, some of the hand's hidden."""
    seen = markers + _NOISE_MM * rng.normal(size=markers.shape)
    hidden = rng.random((len(markers) // _HIDDEN_FRAMES + 1, N_HAND)) < _HIDDEN_SHARE
    rows, columns = np.nonzero(np.repeat(hidden, _HIDDEN_FRAMES, axis=0)[: len(markers)])
    seen[rows, N_FACE + columns] = np.nan
    return voice.invert(seen, rate_hz=50.0)


def paced(score: Score, *, seed: int = 0) -> Iterator[Score]:
    """Yield the phones of a score at other paces, with lengths as uneven as real speakers'."""
    rng = np.random.default_rng([seed, 72])
    for pace in PACES:
        time_s, phones = 1.0, list[Phone]()
        for before, phone in itertools.pairwise([score.phones[0], *score.phones]):
            time_s += max(0.0, phone.start - before.end) if phones else 0.0
            length = pace * (phone.end - phone.start) * float(np.exp(_UNEVENNESS * rng.normal()))
            phones.append(Phone(phone.symbol, time_s, time_s + length))
            time_s += length
        yield Score(tuple(phones), ())


def examples(voice: Voice) -> Iterator[Motion]:
    """Yield the performances of a voice's cuer that its tables are trained on, the exact one first.

    Raises
    ------
    CueError
        If the voice is no virtual cuer's.
    """
    yield perform(voice, recital(sentences()), seed=3)
    yield imprecise(voice, recital(sentences()[1::4], seed=2), seed=7, law="lognormal")
