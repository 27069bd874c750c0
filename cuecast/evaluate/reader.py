"""Whether somebody who never met our cuer can read her.

The reader (`cuecast.evaluate.reading`) is taught on the utterances of real cuers in a folder
(``--clips``) with transcripts but without times. She reads real ones that she was not taught on,
rule-based virtual cuers and the second one, before and after the readable pace, and films of the
avatar as a receiver draws her, if an image tracker is at hand. She gets used to each cuer without
transcripts. Nothing that she learns is kept.

Where labels and cuers differ on a vowel's placement (schwa and eu, open and closed o, un), either
counts, for all cuers alike; a key that repeats its predecessor is asked for once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENTS, SHAPES, Score
from codec.errors import CueError
from cuecast.command.voices import coding_voice
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.reading.lips import LipReader, canonical, teach_lips
from cuecast.evaluate.reading.performed import filmed_takes, simulated_takes
from cuecast.evaluate.reading.reader import Asked, CueReader, ReaderTake, ReadKey, teach
from cuecast.evaluate.reading.takes import real_takes
from cuecast.evaluate.reading.view import with_usual_lips
from synth.capture.tracker.video import find_tracker
from synth.motion.measured.cuer import MEASURED
from synth.motion.measured.plan import paced
from synth.planning.prosody.pacing import READABLE, Pace
from synth.planning.scoring.text_score import Reading, score_of_text
from synth.studio.recital import sentences

_FOLDS = 4
"""Parts of the real takes; each is read by a reader taught on the others."""

_TAKES, _FILMS = 24, 8
"""Sentences of a virtual cuer, and of her film, which takes longer."""

_SKIPPED, _WRONG = 0.55, 0.5
"""Prices of a key that has no counterpart, and of a wrong shape or placement, in comparing lines:
those of ``shared/tools/real_cuers.py``."""

_LEAST_SHARE = 0.05
"""Least share of a class for a confusion to be listed."""

REAL = "real"


@dataclass(frozen=True, slots=True)
class ReaderTestSet:
    """The material: a name, the pace, the source of landmarks, and the takes."""

    name: str
    pace: str
    landmarks: str
    takes: Callable[[EvaluateOptions, Voice], list[ReaderTake]]


@dataclass(slots=True)
class Count:
    """The intended and the read keys."""

    asked: int = 0
    read: int = 0
    keys: int = 0
    phones_asked: int = 0
    phones_read: int = 0
    phones: int = 0
    shapes: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((len(SHAPES), len(SHAPES)), dtype=np.int64)
    )
    places: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((len(PLACEMENTS), len(PLACEMENTS)), dtype=np.int64)
    )
    """Asked for by read; column 0: not read, row 0: not asked for."""


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Return a row of shares for each leg, then one per shape and placement, legs side by side.

    Parameters
    ----------
    options : EvaluateOptions
        ``clips`` names the real takes, ``channels`` some of `LEGS`.

    Raises
    ------
    CueError
        If no folder is named, it is of no use, or a leg is unknown.
    """
    if options.clips is None:
        raise CueError("a reader is taught on real cuers: name their folder by --clips")
    names = options.channels or (REAL, *LEGS)
    if unknown := set(names) - {REAL, *LEGS}:
        raise CueError(f"no cuers called {min(unknown)!r}, there are: {', '.join((REAL, *LEGS))}")
    voice = coding_voice(options.voice)
    real = real_takes(options.clips, voice)
    options.say(f"{len(real)} real takes")
    reader = teach(real)
    lips = teach_lips(real, reader)
    counts: dict[str, Count] = {}
    for name in names:
        options.say(name)
        if name == REAL:
            counts[name] = unseen(real)
        elif LEGS[name].landmarks == TRACKED and find_tracker(None) is None:
            options.say(f"{name}: there is no image tracker (CUECAST_TRACKER): not measured")
        else:
            counts[name] = compared(LEGS[name].takes(options, voice), real, reader, lips)
    return [*(_shares(name, count) for name, count in counts.items()), *_classes(counts)]


def unseen(real: Sequence[ReaderTake]) -> Count:
    """Return how well real takes are read by readers taught on the others."""
    if len(real) < 2 * _FOLDS:
        raise CueError(f"{len(real)} real takes; {2 * _FOLDS} are needed")
    total = Count()
    for fold in range(_FOLDS):
        taught = [take for number, take in enumerate(real) if number % _FOLDS != fold]
        reader = teach(taught)
        compared(real[fold::_FOLDS], taught, reader, teach_lips(taught, reader), total)
    return total


def compared(
    takes: Sequence[ReaderTake],
    known: Sequence[ReaderTake],
    reader: CueReader,
    lips: LipReader,
    total: Count | None = None,
) -> Count:
    """Return how well the reader reads the takes of one cuer, added to `total`.

    Parameters
    ----------
    takes : sequence of ReaderTake
    known : sequence of ReaderTake
        Those that she was taught on.
    reader : CueReader
    lips : LipReader
    total : Count, optional
    """
    total = total or Count()
    views = with_usual_lips([take.view for take in takes], [take.view for take in known])
    reader = reader.used_to(views)
    for take, seen in zip(takes, views, strict=True):
        read = _merged(reader.read(seen))
        _count(total, take.asked, read)
        said = [canonical(phone) for one in take.asked for phone in one.phones]
        _count_phones(total, said, lips.phones(seen, read))
    return total


def _merged(read: Sequence[ReadKey]) -> list[ReadKey]:
    """Return keys without those that repeat the one before."""
    out: list[ReadKey] = []
    for key in read:
        if not out or (out[-1].shape, out[-1].place) != (key.shape, key.place):
            out.append(key)
    return out


def _count(total: Count, wanted: Sequence[Asked], read: Sequence[ReadKey]) -> None:
    def price(i: int, j: int) -> float:
        one, key = wanted[i], read[j]
        return _WRONG * (one.shape != key.shape) + _WRONG * (key.place not in one.places)

    total.asked += len(wanted)
    total.read += len(read)
    for i, j in in_step(len(wanted), len(read), price):
        shape, place = (0, 0) if j is None else (read[j].shape, read[j].place)
        if i is None:
            total.shapes[0, shape] += 1
            total.places[0, place] += 1
            continue
        # A placement that counts stands for the one that was asked for.
        asked_place = place if place in wanted[i].places else wanted[i].places[0]
        total.shapes[wanted[i].shape, shape] += 1
        total.places[asked_place, place] += 1
        total.keys += shape == wanted[i].shape and place in wanted[i].places


def _count_phones(total: Count, said: Sequence[str], found: Sequence[str]) -> None:
    total.phones_asked += len(said)
    total.phones_read += len(found)
    total.phones += sum(
        i is not None and j is not None and said[i] == found[j]
        for i, j in in_step(len(said), len(found), lambda i, j: float(said[i] != found[j]))
    )


def in_step(
    asked: int, read: int, price: Callable[[int, int], float]
) -> list[tuple[int | None, int | None]]:
    """Return the cheapest way to go through two lines together (edit distance).

    Examples
    --------
    >>> in_step(2, 1, lambda i, j: float(i != 1))
    [(0, None), (1, 0)]
    """
    cost = np.zeros((asked + 1, read + 1))
    cost[:, 0], cost[0] = _SKIPPED * np.arange(asked + 1), _SKIPPED * np.arange(read + 1)
    for i in range(1, asked + 1):
        for j in range(1, read + 1):
            cost[i, j] = min(
                cost[i - 1, j - 1] + price(i - 1, j - 1),
                cost[i - 1, j] + _SKIPPED,
                cost[i, j - 1] + _SKIPPED,
            )
    line: list[tuple[int | None, int | None]] = []
    i, j = asked, read
    while i or j:
        if i and j and cost[i, j] == cost[i - 1, j - 1] + price(i - 1, j - 1):
            i, j = i - 1, j - 1
            line.append((i, j))
        elif i and (not j or cost[i, j] == cost[i - 1, j] + _SKIPPED):
            i -= 1
            line.append((i, None))
        else:
            j -= 1
            line.append((None, j))
    return line[::-1]


TRACKED = "tracked film"


def _texts(number: int) -> list[str]:
    return sentences(held_out=True)[:number]


def _scores(number: int, pace: Pace | None) -> list[Score]:
    return [score_of_text(text, start_s=1.0, reading=Reading(pace=pace)) for text in _texts(number)]


def _simulated(
    cuer: str, pace: Pace | None
) -> Callable[[EvaluateOptions, Voice], list[ReaderTake]]:
    def takes(options: EvaluateOptions, voice: Voice) -> list[ReaderTake]:
        scores = _scores(_TAKES, pace)
        if cuer.endswith(MEASURED):
            scores = [paced(score) for score in scores]
        return simulated_takes(cuer, scores, seed=options.seed)

    return takes


def _filmed(pace: Pace | None) -> Callable[[EvaluateOptions, Voice], list[ReaderTake]]:
    def takes(options: EvaluateOptions, voice: Voice) -> list[ReaderTake]:
        tracker = find_tracker(None)
        assert tracker is not None
        scores = _scores(_FILMS, pace)
        return filmed_takes(
            voice, scores, tracker=tracker, folder=options.folder, seed=options.seed
        )

    return takes


_SIMULATED = "simulated tracker"
_BY_RULE = "minimum-jerk"

LEGS = {
    leg.name: leg
    for leg in (
        ReaderTestSet("claire", "readable", _SIMULATED, _simulated(f"claire/{_BY_RULE}", READABLE)),
        ReaderTestSet("claire-sync", "in step", _SIMULATED, _simulated(f"claire/{_BY_RULE}", None)),
        ReaderTestSet("agathe", "readable", _SIMULATED, _simulated(f"agathe/{_BY_RULE}", READABLE)),
        ReaderTestSet("second", "her own", _SIMULATED, _simulated(f"solange/{MEASURED}", None)),
        ReaderTestSet("film", "readable", TRACKED, _filmed(READABLE)),
        ReaderTestSet("film-sync", "in step", TRACKED, _filmed(None)),
    )
}
"""Test sets beside real takes, by name; ``--channels`` chooses."""


def _shares(name: str, count: Count) -> dict[str, Any]:
    pace, landmarks = (
        ("her own", TRACKED) if name == REAL else (LEGS[name].pace, LEGS[name].landmarks)
    )
    shapes, places = (int(np.trace(table[1:, 1:])) for table in (count.shapes, count.places))
    return {
        "of": "all", "cuer": name, "pace": pace, "landmarks": landmarks, "keys": count.asked,
        "precision": _share(count.keys, count.read), "recall": _share(count.keys, count.asked),
        "shapes": _share(shapes, count.asked), "placements": _share(places, count.asked),
        "phones_precision": _share(count.phones, count.phones_read),
        "phones_recall": _share(count.phones, count.phones_asked),
    }  # fmt: skip


def _classes(counts: dict[str, Count]) -> list[dict[str, Any]]:
    """Return the share right of each shape and placement, and its confusions."""
    names = [f"shape {shape}" for shape in SHAPES[1:]] + list(PLACEMENTS[1:])
    rows: list[dict[str, Any]] = [{"of": name} for name in names]
    for cuer, count in counts.items():
        tables = [(count.shapes, [str(s) for s in SHAPES]), (count.places, list(PLACEMENTS))]
        lines = [(table[k], k, heads) for table, heads in tables for k in range(1, len(table))]
        for row, (line, own, heads) in zip(rows, lines, strict=True):
            row[cuer] = _share(int(line[own]), int(line.sum()))
            row[f"{cuer} taken for"] = _confusions(line, own, ["none", *heads[1:]])
    return rows


def _confusions(line: NDArray[np.int64], own: int, heads: list[str]) -> str:
    total = max(int(line.sum()), 1)
    often = [(k, int(n)) for k, n in enumerate(line) if k != own and n >= _LEAST_SHARE * total]
    often.sort(key=lambda pair: -pair[1])
    return ", ".join(f"{heads[k]} {n / total:.2f}" for k, n in often) if line.sum() else "-"


def _share(part: int, whole: int) -> float | None:
    return round(part / whole, 4) if whole else None


def plot(results: list[dict[str, Any]], figure: Any) -> None:
    """Plot the share of each shape and placement that was read, cuers side by side."""
    cuers = [row["cuer"] for row in results if row["of"] == "all"]
    rows = [row for row in results if row["of"] != "all"]
    axes = figure.subplots()
    at = np.arange(len(rows))
    wide = 0.8 / max(len(cuers), 1)
    for number, cuer in enumerate(cuers):
        axes.bar(
            at + wide * (number - 0.5 * (len(cuers) - 1)),
            [row.get(cuer) or 0 for row in rows],
            wide,
            label=cuer,
        )
    axes.set_xticks(at, [row["of"] for row in rows], rotation=45, ha="right")
    axes.set_ylabel("share read right")
    axes.legend(ncols=2)
