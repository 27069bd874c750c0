"""Phones of a text to their times in a recording of it.

In: the words of passages and the sound of each.  Out: phones with times.  espeak-ng speaks the
phones, with times that are known exactly, over the background of the recording; models of the
phones are estimated on that rendering; the recording is cut by them, with the usual durations of
phones as a prior, silence and other speech allowed between words, and words that are not spoken
left out; then the models are estimated again on the recording itself and it is cut anew.
Sources: F. Malfrère, T. Dutoit 1997 (alignment by synthesis); segmental Viterbi search with
explicit durations (L. Rabiner 1989, section IV.D).

Dynamic time warping of the rendering as a first step was tried and left out: on 14 recordings
of several speakers the median error was the same without it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER
from codec.cues.score import Phone
from synth.alignment import _kernels
from synth.alignment.cepstra import FRAME_RATE, cepstra
from synth.alignment.models import PARTS, PhoneModels, Unit, estimate
from synth.alignment.rows import (
    FILLER,
    RENDERED_HZ,
    SHORTEST_FRAMES,
    Passage,
    Row,
    is_phone,
    kinds_of,
    length_costs,
    rendered,
    row_of,
    skips_of,
)

__all__ = ["Aligned", "Passage", "align"]

ROUNDS = 3
"""How often the models are estimated on the recording."""

PRIOR_FRAMES = 200.0
"""Weight of the rendering against the recording, whose cuts may be wrong: of 20, 100 and 200 the
last misplaced the fewest words under music (23 against 40 % under strings as loud as the voice)."""

FILLER_COST = 7.5
"""What a frame of other speech costs above the best phone: the right phones cost 6 to 7 more."""

FILLER_ENTRY = 20.0
"""What a stretch of other speech costs, however long."""

SKIP_COST = 200.0
"""What a word that is not spoken costs, as much as some 20 frames that fit badly."""

SLOPE = 0.5
"""What each frame costs by which a word begins outside its subtitle."""

_QUIET = 0.15
"""Share of a minute's pieces, the softest, whose sound counts as background."""

_PIECE = 1600
"""The background is heard in the quietest pieces of 0.1 s, one of seven."""

_ENTRY = {PAUSE: 0.0, FILLER: FILLER_ENTRY}


@dataclass(frozen=True, slots=True)
class Aligned:
    """Where the phones of a passage were found.

    Attributes
    ----------
    phones : tuple of Phone
        On the programme's clock. Those of words that are not spoken lie where they would be.
    fits : ndarray of float64, shape (words,)
        How much likelier the frames of each word are under its own phones than under the median
        phone, in the logarithm per frame; 0 for words that are not spoken. What the figure is
        worth only a comparison with other words on the same sound tells
        (`synth.alignment.trust`): models fit to anything.
    spoken : ndarray of bool, shape (words,)
        Whether the word was found at all.
    """

    phones: tuple[Phone, ...]
    fits: NDArray[np.float64]
    spoken: NDArray[np.bool_]


_NOTHING = Aligned((), np.zeros(0), np.zeros(0, np.bool_))


def align(passages: Sequence[Passage], *, rounds: int = ROUNDS) -> list[Aligned]:
    """Return the phones of each passage with their times on the programme's clock.

    Parameters
    ----------
    passages : sequence of Passage
        Of one speaker or of few; some minutes at a time.
    rounds : int
        How often the models are estimated on the recording.

    Raises
    ------
    CueError
        If a passage is too short for its phones.

    Examples
    --------
    >>> from synth.alignment.cepstra import mono
    >>> from synth.speech.espeak_voice import render
    >>> from synth.text.pronounce import phonemise
    >>> words = tuple(phonemise("Bonjour à tous."))
    >>> spoken = render([s for word in words for s in word.phones])
    >>> found = align([Passage(words, mono(spoken.samples, 22_050))])[0].phones
    >>> max(abs(a.start - b.start) for a, b in zip(found, spoken.phones)) < 0.04
    True
    """
    filled = [passage for passage in passages if passage.words]
    if not filled:
        return [_NOTHING for _ in passages]
    rows = [row_of(passage, cepstra(passage.samples)) for passage in filled]
    background = _background([passage.samples for passage in filled])
    taught = [rendered(p.words, background, rate_hz) for p in filled for rate_hz in RENDERED_HZ]
    models = estimate(*_gathered(taught))
    for _ in range(rounds):
        for row in rows:
            _cut(row, models)
        models = estimate(*_gathered(rows), prior=models, prior_frames=PRIOR_FRAMES)
    for row in rows:
        _cut(row, models)
    found = iter(zip(filled, rows, strict=True))
    return [_aligned(*next(found), models) if p.words else _NOTHING for p in passages]


def _background(sounds: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return what is heard beside the voices, in units of their strength."""
    x = np.concatenate(sounds)
    pieces = x[: len(x) // _PIECE * _PIECE].reshape(-1, _PIECE)
    if not len(pieces):
        return np.zeros(1)
    power = (pieces**2).mean(axis=1)
    quiet = np.sort(np.argsort(power, kind="stable")[: max(1, round(_QUIET * len(pieces)))])
    whole = float(power.mean())
    voice = max(whole - float(power[quiet].mean()), 0.05 * whole) + 1e-12
    return np.asarray(pieces[quiet].ravel() / np.sqrt(voice))


def _gathered(rows: Sequence[Row]) -> tuple[NDArray[np.float32], list[Unit]]:
    """Return the features of all rows in one line, and their phones and pauses in it."""
    units: list[Unit] = []
    offset = 0
    for row in rows:
        units += [unit for unit in row.units(offset) if unit[0] != FILLER]
        offset += len(row.features)
    return np.concatenate([row.features for row in rows]), units


def _cut(row: Row, models: PhoneModels) -> None:
    """Cut a passage by the models; keep the old cuts if nothing fits."""
    starts = np.zeros(len(row.symbols) + 1, np.int64)
    costs = models.costs(row.features)
    filler = np.zeros((1, *costs.shape[1:]))
    filler[0, 0] = models.filler(costs) + FILLER_COST * np.arange(costs.shape[2])
    if _kernels.segment_into(
        np.concatenate([costs, filler]), kinds_of(row.symbols),
        np.array([_ENTRY.get(symbol, -1.0) for symbol in row.symbols]), length_costs(row),
        SHORTEST_FRAMES, row.window, SLOPE, skips_of(row.symbols), SKIP_COST, starts,
    ):  # fmt: skip
        row.starts = starts


def _aligned(passage: Passage, row: Row, models: PhoneModels) -> Aligned:
    costs = models.costs(row.features)
    phones: list[Phone] = []
    fits, said = np.zeros(len(passage.words)), np.ones(len(passage.words), np.bool_)
    units = iter([unit for unit in row.units() if is_phone(unit[0])])
    for number, word in enumerate(passage.words):
        own = [next(units) for _ in word.phones]
        said[number] = own[-1][2] > own[0][1]
        if said[number]:
            fits[number] = np.mean([_fit(unit, costs) for unit in own])
        for symbol, first, end in own:
            start_s = passage.start_s + first / FRAME_RATE
            end_s = passage.start_s + max(end, first + 1) / FRAME_RATE
            phones.append(Phone(symbol, start_s, end_s))
    return Aligned(tuple(phones), fits, said)


def _fit(unit: Unit, costs: NDArray[np.float64]) -> float:
    """Return how much less a phone costs per frame than the median phone in its place."""
    symbol, first, end = unit
    cuts = [first + (part * (end - first)) // PARTS for part in range(PARTS + 1)]
    pieces = [costs[:, p, cuts[p + 1]] - costs[:, p, cuts[p]] for p in range(PARTS)]
    every = np.sum(pieces, axis=0)
    number = PHONE_NUMBER[symbol]
    return float((np.median(np.delete(every, PHONE_NUMBER[PAUSE])) - every[number]) / (end - first))
