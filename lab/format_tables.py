"""Offline training of the format's tables of `codec.superframe.tables`.

Example scores and residuals go in, integer tables come out: counts of phones, lengths, keys and
indices, smoothed such that every event keeps a probability. Changing them changes the format. The
program that runs it is ``python -m lab.coding --format``.
"""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cues.language import french
from codec.cues.score import Score
from codec.cues.timeline import TICKS, ScoreLine, to_line
from codec.files.data import DATA
from codec.files.whole import whole_file
from codec.superframe import _kernels
from codec.superframe.coding import Coding
from codec.superframe.preview import CELL, SILENCE, preview_of
from codec.superframe.quantise import Setting, quantise_rd, width_mm
from codec.superframe.range_coder import TOTAL, cumulative
from codec.superframe.score_coding import part_of
from codec.superframe.superframe import resynthesis_of
from codec.superframe.tables import (
    CLASSES,
    CONTEXTS,
    PAUSE_LENGTHS,
    TEMPOS,
    CoefficientTables,
    ScoreTables,
    coefficient_tables_of,
    present_tables,
)
from codec.superframe.transform import Basis
from codec.training.coding_tables import blocks_of, near, parts_of

FRENCH = french()
N = FRENCH.n_phones
_PHASES = 8
"""Places at which every score is cut into superframes."""

_PAUSE_FIRST = 0.05
"""Share of compact superframes that begin with a pause (their writer decides)."""

_UNSEEN = (1.0, 2.0, 3.0)
"""Examples that the rest counts for, per kind of phone found after none, one and two others."""

_OF_ANY = 640.0
"""Examples that keys count for whatever stands before."""

Counts = NDArray[np.float64]


def train_score(scores: Iterable[Score]) -> dict[str, list[object]]:
    """Return the tables of `codec.superframe.tables.ScoreTables` as nested lists of integers.

    Parameters
    ----------
    scores : iterable of Score
        Examples; only phones and their times matter.

    Returns
    -------
    dict of nested lists
        Frequencies that sum to 2**15 in every row.
    """
    first = np.zeros(N)
    left, length = np.zeros((N, TICKS + 1)), np.zeros((N, TEMPOS, TICKS + 1))
    whole, keys = _Whole(), _Keys()
    for score in scores:
        line = to_line(score)
        whole.count(line)
        for phase in range(_PHASES):
            _count(score.shifted(phase * 0.08), first, left, length)
            keys.count(to_line(score.shifted(phase * 0.08)))
    return {
        "first": _rows(first + 1),
        "next": _rows(_after_two(whole.following)),
        "left": _rows(_by_kind(left, 100.0)),
        "length": _rows(_lengths(length)),
        "opening": _rows(whole.opening + _PAUSE_FIRST * whole.opening.sum() * _is_pause()),
        "pause": _rows(_widened(whole.pause, 300.0)),
        "usual": whole.usual(),
        "key": _rows(_backed(keys.key / _PHASES, _shares(keys.key.sum(axis=0)), _UNSEEN[1])),
        "gap": _rows(_back_off(keys.gap, _blurred(keys.gap.sum(axis=0)) + 0.5, 20.0)),
        **_of_hands(_rows(_backed(keys.key / _PHASES, _shares(keys.key.sum(axis=0)), _UNSEEN[1]))),
    }


_HELD_TICKS, _HELD_SPREAD = 15.0, 0.5
"""Median length in ticks of keys of real cuers, and the deviation of its logarithm."""


_ANY_KEY = 0.4
"""Share of keys that a hand shows, or somebody reads off it, as if all were alike."""


def _of_hands(keys: list[object]) -> dict[str, list[object]]:
    """Return the tables of keys that were read off a hand, from those of keys in a row.

    Their lengths are those of real cuers: log-normal, and as much for all that are longer.
    """
    ticks = np.arange(1, TICKS + 2)
    share = np.exp(-0.5 * np.square(np.log(ticks / _HELD_TICKS) / _HELD_SPREAD)) / ticks
    rows = np.array(keys, dtype=np.float64)[:, : SILENCE + 1]
    chain = rows[: SILENCE + 1] / rows[: SILENCE + 1].sum(axis=1, keepdims=True)
    usual = np.full(SILENCE + 1, 1 / (SILENCE + 1))
    for _ in range(_MIXED):
        usual = usual @ chain
    usual = (1 - _ANY_KEY) * usual + _ANY_KEY / (SILENCE + 1)
    return {"held": _rows(share + 0.002 * share.sum()), "alone": _rows(usual)}


_MIXED = 50
"""Keys after which a row of keys has forgotten how it began."""


def _is_pause() -> Counts:
    """Return 1 for the letter of a pause, and a little for all."""
    return np.where(np.arange(N) == FRENCH.letter_of(0), 1.0, 0.01)


class _Whole:
    """Counts of whole phones, as compact superframes code them."""

    def __init__(self) -> None:
        self.opening = np.zeros(N)
        self.following = np.zeros((N, N, N))
        self.pause = np.zeros(PAUSE_LENGTHS)
        self._ticks, self._phones = np.zeros(N), np.zeros(N)

    def count(self, line: ScoreLine) -> None:
        context = 0, 0
        for k in range(1, len(line.starts)):
            self.following[context][FRENCH.letter_of(line.numbers[k])] += 1
            context = context[1], line.numbers[k]
        for k in range(1, len(line.starts) - 1):
            number, ticks = line.numbers[k], line.starts[k + 1] - line.starts[k]
            if number == 0:
                units = min((ticks + line.starts[k] % 2) // 2, PAUSE_LENGTHS - 1)
                self.pause[max(units, 1) - 1] += 1
                continue
            self.opening[FRENCH.letter_of(number)] += 1
            self._ticks[number] += ticks
            self._phones[number] += 1

    def usual(self) -> list[object]:
        """Return the mean lengths in sixteenths of a tick."""
        mean = self._ticks.sum() / self._phones.sum()
        ticks = (self._ticks + mean) / (self._phones + 1)
        rounded: list[object] = np.rint(16 * ticks).astype(int).tolist()
        return rounded


class _Keys:
    """Counts of keys and silences, as previews code them."""

    def __init__(self) -> None:
        self.key = np.zeros((SILENCE + 2, SILENCE + 2))
        self.gap = np.zeros((SILENCE + 2, TICKS // CELL + 1))

    def count(self, line: ScoreLine) -> None:
        for index in range(line.starts[-1] // TICKS + 1):
            cell, before = -1, SILENCE + 1
            for tick, symbol in preview_of(part_of(line, index)):
                self.gap[before, tick // CELL - cell - 1] += 1
                self.key[before, symbol] += 1
                cell, before = tick // CELL, symbol
            # What the superframe's end hides counts by how gaps go on elsewhere.
            rest = self.gap[before, TICKS // CELL - 1 - cell :]
            rest += (rest + 0.01) / (rest + 0.01).sum()


def _count(score: Score, first: Counts, left: Counts, length: Counts) -> None:
    line = to_line(score)
    for index in range(line.starts[-1] // TICKS + 1):
        part = part_of(line, index)
        first[FRENCH.letter_of(part.first)] += 1
        left[part.first, part.first_end] += 1
        last = 0
        ends = (*part.starts, TICKS)[1:]
        for number, start, end in zip(part.numbers, part.starts, ends, strict=True):
            if end < TICKS:
                length[number, ScoreTables.tempo(last), end - start - 1] += 1
            else:
                # A cut phone counts by how such phones go on where they are not cut.
                rest = length[number, ScoreTables.tempo(last), end - start - 1 :]
                if rest.sum() > 0:
                    rest += rest / rest.sum()
            last = end - start if number else 0


def _after_two(counts: Counts) -> Counts:
    """Return the rows of phones after two others, 38 for the earlier one if it is not known.

    Each is smoothed by what follows the later one alone, and that by what there is at all, the
    more the more kinds of phones were found (Witten and Bell 1991).
    """
    single = counts.sum(axis=0)
    every = _backed(single.sum(axis=0), np.full(N, 1.0 / N), _UNSEEN[0])
    later = _backed(single, every, _UNSEEN[1])
    both = _backed(counts, later, _UNSEEN[2])
    return np.concatenate([both, later[None]])


def _shares(counts: Counts) -> Counts:
    shares: Counts = (counts + 0.5) / (counts + 0.5).sum()
    return shares


def _backed(counts: Counts, prior: Counts, unseen: float) -> Counts:
    """Return shares: counts, and as many examples of `prior` as there are kinds, or more."""
    kinds = np.maximum(unseen * (counts > 0).sum(axis=-1, keepdims=True), 1.0)
    shares: Counts = (counts + kinds * prior) / (counts.sum(axis=-1, keepdims=True) + kinds)
    return shares


def _kinds() -> list[list[int]]:
    consonants = [n for n in range(N) if FRENCH.is_consonant(n)]
    return [[0], [n for n in range(N) if FRENCH.is_vowel(n)], consonants]


def _back_off(counts: Counts, prior: Counts, weight: float) -> Counts:
    """Return rows of counts plus `weight` examples that follow `prior`."""
    smoothed: Counts = counts + weight * prior / prior.sum()
    return smoothed


def _by_kind(counts: Counts, weight: float) -> Counts:
    """Smooth every phone's row by the sum over its kind: pause, vowel or consonant."""
    result = np.empty_like(counts)
    for kind in _kinds():
        prior = _blurred(counts[kind].sum(axis=0)) + 0.5
        result[kind] = _back_off(counts[kind], prior, weight)
    result[0] = _widened(counts[0], weight)
    return result


def _widened(counts: Counts, weight: float) -> Counts:
    """Smooth lengths of pauses: the examples' have a few lengths, those of speakers any."""
    prior = _blurred(counts) + 0.5
    return _back_off(counts, prior + prior.mean(), float(counts.sum()) + weight)


def _lengths(counts: Counts) -> Counts:
    result = np.empty_like(counts)
    for tempo in range(TEMPOS):
        result[:, tempo] = _by_kind(counts[:, tempo], 300.0)
    return result


def _blurred(counts: Counts) -> Counts:
    """Spread counts over neighbouring lengths: other speakers have other clocks."""
    wide = np.concatenate([[0.0], counts, [0.0]])
    return np.asarray(0.25 * wide[:-2] + 0.5 * wide[1:-1] + 0.25 * wide[2:], dtype=np.float64)


def _rows(counts: Counts) -> list[object]:
    table = np.array([np.diff(cumulative(row)) for row in counts.reshape(-1, counts.shape[-1])])
    rows: list[object] = table.reshape(counts.shape).tolist()
    return rows


Array = NDArray[np.float64]

TABLES = DATA / "tables.json"


def write_tables(document: dict[str, Any], path: Path = TABLES) -> None:
    """Write the tables, one row of numbers per line, through a temporary name."""
    text = json.dumps(document, ensure_ascii=False, separators=(",", ":")).replace("],", "],\n")
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def format_tables(
    coding: Coding,
    motions: Sequence[Motion],
    imprecise: Sequence[Motion],
    scores: Sequence[Score],
    others: Sequence[Motion] = (),
) -> dict[str, Any]:
    """Return the document of the format's tables.

    Parameters
    ----------
    coding : Coding
        Of the motions' voice.
    motions, imprecise : sequence of Motion
        Give the coefficients; the latter those of the loose basis.
    scores : sequence of Score
        Give phones and lengths; without any, the present tables of the score stay.
    others : sequence of Motion
        Of other cuers, as in `codec.training.coding_tables.train_coding`.
    """
    residual, loose, plain = list[Array](), list[Array](), list[Array]()
    filmed = [coding.filmed.forward(block - coding.mean) for m in others for block in blocks_of(m)]
    for basis, examples, found in (
        (coding.residual, motions, residual),
        (coding.loose, imprecise, loose),
    ):
        for motion in examples:
            blocks = blocks_of(motion)
            parts = parts_of(motion, len(blocks))
            for k, block in enumerate(blocks):
                prediction = resynthesis_of(coding, near(parts, k), k).params()
                found.append(basis.forward(block - prediction))
                plain.append(coding.plain.forward(block - coding.mean))
    coefficient = train_coefficients(
        [
            (coding.residual, residual),
            (coding.loose, loose),
            (coding.plain, plain),
            (coding.filmed, filmed),
        ]
    )
    score = train_score(scores) if scores else present_tables()["score"]
    score |= _of_hands(score["key"])
    return {"language": present_tables()["language"], "score": score, "coefficient": coefficient}


_SPREAD = (0.6, 1.0, 1.5, 2.2)
"""Assumed scale of a coefficient in each context, relative to its class, before training."""

_PRIOR = 200.0
"""Weight of that assumption against counted indices."""

_STEPS = range(8, 33, 2)

_ROUNDS = 3
"""Rounds; each chooses indices by the tables and counts tables from the indices."""

_INSET = 0.45
"""Largest distance of a reconstruction point from its cell's middle, in steps."""

_ZERO_CELL = 0.6
"""Half width of the cell of zero in steps: what rate-distortion quantisation makes of it."""


def train_coefficients(examples: Sequence[tuple[Basis, Sequence[Array]]]) -> dict[str, Any]:
    """Return ``magnitude`` and ``inset`` as nested lists of integers.

    Parameters
    ----------
    examples : sequence of (Basis, sequence of ndarray of float64, shape (32 P,))
        Bases with coefficients in their scan order.
    """
    tables = laplacian_tables()
    for _ in range(_ROUNDS):
        tables = _counted(examples, coefficient_tables_of(tables))
    return tables


def _counted(
    examples: Sequence[tuple[Basis, Sequence[Array]]], tables: CoefficientTables
) -> dict[str, Any]:
    """Return the tables of indices that were chosen under `tables`."""
    counts = np.zeros((CLASSES, CONTEXTS, _kernels.ESCAPE + 1), dtype=np.int64)
    insets = np.zeros((CLASSES, 3, 2))
    for basis, blocks in examples:
        for values in blocks:
            for step in _STEPS:
                _kernels.count_coefficients(
                    values, quantise_rd(values, Setting(step), basis, tables), basis.scan_scales,
                    basis.before, step, width_mm(step), counts, insets,
                )  # fmt: skip
    weights = counts + _PRIOR * np.array(laplacian_tables()["magnitude"]) / TOTAL
    freqs = [[np.diff(cumulative(row)).tolist() for row in kind] for kind in weights]
    weight = insets[:, :, 1] + _PRIOR / 10
    inset = (insets[:, :, 0] + _PRIOR / 10 * tables.inset / 256) / weight
    points = np.rint(256 * np.clip(inset, -_INSET, _INSET)).astype(int)
    return {"magnitude": freqs, "inset": points.tolist()}


def laplacian_tables() -> dict[str, Any]:
    """Return ``magnitude`` and ``inset`` for Laplacian coefficients.

    The class says the ratio of standard deviation to step, 2**((class - 16) / 4); cells are a
    step wide, the one of zero reaches to 0.6 of a step.
    """
    magnitude, inset = [], []
    edges = np.concatenate([[0.0], np.arange(_kernels.ESCAPE) + _ZERO_CELL, [np.inf]])
    for kind in range(CLASSES):
        ratio = 2 ** ((kind - 16) / 4)
        rows = []
        for spread in _SPREAD[:CONTEXTS]:
            tail = np.exp(-edges * np.sqrt(2) / (ratio * spread))
            rows.append(np.diff(cumulative(tail[:-1] - tail[1:] + 1e-4)).tolist())
        magnitude.append(rows)
        rate = np.sqrt(2) / ratio
        centre = _ZERO_CELL + 1 / rate - 1 / np.expm1(min(rate, 50.0))
        inset.append([round(256 * min(max(0.0, 1.0 - centre), 0.49))] * 3)
    return {"magnitude": magnitude, "inset": inset}
