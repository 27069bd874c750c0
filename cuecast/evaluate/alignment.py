"""Accuracy of the aligner's words, and calibration of its confidence.

Material (``--clips``): sounds with label tracks beside them, one word a line with its start and end
in seconds between tabs (``NAME.wav`` and ``NAME.txt``, as Audacity writes them); without,
renderings of sentences, whose times are known exactly. Conditions (``--channels``): ``plain``,
``condensed`` (a third of the words is not in the text), ``music`` (as loud as the voice, over it),
``foreign`` (the words of another clip: none may be accepted). Subtitles are half a second wider
than their words.
"""

import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE
from codec.errors import CueError
from cuecast.demo.content import FS as MUSIC_FS
from cuecast.demo.content import make_music
from cuecast.evaluate.options import EvaluateOptions
from synth.language.text.espeak import RATE_HZ
from synth.language.text.pronounce import phonemise
from synth.language.text.sentences import read_sentences
from synth.planning.alignment.align import Aligned, SpokenPassage, align_passages
from synth.planning.alignment.confidence import CERTAIN, WITHIN_S, trust
from synth.planning.alignment.recogniser import FS
from synth.planning.alignment.runs import LONGEST_PASSAGE_S
from synth.planning.alignment.sound import mono
from synth.units.speech.espeak_voice import render

CONDITIONS = ("plain", "condensed", "music", "foreign")

_LEFT_OUT = 1 / 3
"""Share of words that television leaves out."""

_ROOM_S = 0.5
"""Seconds that a subtitle is wider than its words, on either side."""

_LINE_WORDS, _LINE_GAP_S = 8, 0.3
"""A subtitle ends after this many words, or before a pause as long."""

_SENTENCES, _TOGETHER = 24, 4
"""Rendered sentences, and how many of them make a clip."""

_EDGES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, CERTAIN, 0.99, 1.0)
"""Confidences between which words are counted together."""

Row = dict[str, Any]
Found = tuple[float, float | None]
"""Confidence of a word, and by how many seconds it was misplaced where its time is known."""


@dataclass(frozen=True, slots=True)
class Clip:
    """A sound and its words with start and end in seconds."""

    name: str
    sound: NDArray[np.float64]
    words: tuple[tuple[float, float, str], ...]


def evaluate(options: EvaluateOptions) -> list[Row]:
    """Return one row for each condition, and one for each step of the confidence.

    Raises
    ------
    CueError
        If a condition is unknown or a label track is malformed.
    """
    wanted = options.channels or CONDITIONS
    for condition in set(wanted) - set(CONDITIONS):
        raise CueError(f"unknown condition {condition!r}; known: {', '.join(CONDITIONS)}")
    clips = _rendered() if options.clips is None else list(read_clips(options.clips))
    rows, found = [], []
    for condition in wanted:
        options.say(f"aligning {len(clips)} clips: {condition}")
        row, words = _measured(clips, condition, np.random.default_rng(options.seed))
        rows.append(row)
        found += words if condition != "foreign" else []
    return rows + reliability(found)


def read_clips(folder: Path) -> Iterator[Clip]:
    """Yield the sounds of a folder that have a label track.

    Raises
    ------
    CueError
        If there is none, or a label track is malformed.
    """
    tracks = [path for path in sorted(folder.glob("*.txt")) if _sound_of(path) is not None]
    if not tracks:
        raise CueError(f"{folder}: no sound with a label track (NAME.wav and NAME.txt)")
    for path in tracks:
        words = []
        for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
            try:
                start, end, text = line.split("\t")
                words.append((float(start), float(end), text.strip()))
            except ValueError as error:
                raise CueError(f"{path}: line {number} is not start, end, word") from error
        samples, fs = soundfile.read(_sound_of(path))
        yield Clip(path.stem, mono(samples, fs), tuple(words))


def _sound_of(track: Path) -> Path | None:
    found = (track.with_suffix(suffix) for suffix in (".wav", ".flac", ".ogg"))
    return next((path for path in found if path.exists()), None)


def _rendered() -> list[Clip]:
    """Return sentences of espeak-ng's voice, four to a clip, with half a second between them."""
    clips = []
    sentences = read_sentences()
    for number in range(0, _SENTENCES, _TOGETHER):
        sounds, words, clock = [np.zeros(FS // 2)], [], 0.5
        for text in sentences[number : number + _TOGETHER]:
            said = phonemise(text)
            line = [s for w in said for s in (*w.phones, *([PAUSE] if w.pause else []))]
            rendering = render(line, words_per_minute=150)
            times = iter(rendering.phones)
            for word in said:
                own = [next(times) for _ in word.phones]
                words.append((clock + own[0].start, clock + own[-1].end, word.text))
            sounds += [mono(rendering.samples, RATE_HZ), np.zeros(FS // 2)]
            clock += len(sounds[-2]) / FS + 0.5
        clips.append(Clip(f"rendered {number}", np.concatenate(sounds), tuple(words)))
    return clips


def _measured(
    clips: Sequence[Clip], condition: str, rng: np.random.Generator
) -> tuple[Row, list[Found]]:
    """Return the figures of a condition, and confidence and error of each accepted word."""
    errors: list[float] = []
    words: list[Found] = []
    accepted, spent_s, length_s = 0, 0.0, 0.0
    for number, clip in enumerate(clips):
        said = clips[(number + 1) % len(clips)].words if condition == "foreign" else clip.words
        started = time.process_time()
        passages, times = _passages(clip, said, condition, rng)
        found = align_passages(passages)
        verdict = trust(passages, found)
        spent_s += time.process_time() - started
        length_s += len(clip.sound) / FS
        accepted += verdict.holds
        for passage, item, known in zip(passages, found, times, strict=True):
            away = _misplaced(passage, item, known)
            errors += [error for error in away if error is not None]
            if verdict.holds:
                words += zip(verdict.confidence(item.fits).tolist(), away, strict=True)
    row: Row = {"condition": condition, "clips": len(clips), "accepted": accepted}
    row["times_real_time"] = round(length_s / max(spent_s, 1e-9), 1)
    if condition != "foreign":
        row |= {
            "words": len(errors),
            "median_ms": round(1e3 * float(np.median(errors))),
            "beyond_165_ms": round(float((np.array(errors) > WITHIN_S).mean()), 4),
        }
    return row, words


def _passages(
    clip: Clip, said: Sequence[tuple[float, float, str]], condition: str, rng: np.random.Generator
) -> tuple[list[SpokenPassage], list[list[float | None]]]:
    """Return the passages of a clip, and for each word of theirs its time where it is known."""
    sound = clip.sound
    if condition == "music":
        music = mono(make_music(len(sound) / FS), MUSIC_FS)
        sound = sound + np.resize(music / (music.std() + 1e-9) * sound.std(), len(sound))
    passages, times = [], []
    for lines in _runs(list(_lines(said))):
        words, known, expected = [], [], []
        for line in lines:
            kept = [w for w in line if condition != "condensed" or rng.random() > _LEFT_OUT]
            spoken = phonemise(" ".join(text for *_, text in kept or line[:1]))
            words += spoken
            known += _times(kept or line[:1], len(spoken))
            expected += [(line[0][0] - _ROOM_S, line[-1][1] + _ROOM_S)] * len(spoken)
        first = max(0, round((lines[0][0][0] - _ROOM_S) * FS))
        piece = sound[first : round((lines[-1][-1][1] + _ROOM_S) * FS)]
        passage = SpokenPassage(tuple(words), piece, first / FS, np.array(expected).reshape(-1, 2))
        if words and passage.long_enough:
            passages.append(replace(passage, heard=passage.likelihoods()))
            times.append(known)
    return passages, times


def _lines(said: Sequence[tuple[float, float, str]]) -> Iterator[list[tuple[float, float, str]]]:
    """Yield words by subtitle."""
    line: list[tuple[float, float, str]] = []
    for word in said:
        if line and (len(line) == _LINE_WORDS or word[0] - line[-1][1] > _LINE_GAP_S):
            yield line
            line = []
        line.append(word)
    if line:
        yield line


def _runs(
    lines: list[list[tuple[float, float, str]]],
) -> Iterator[list[list[tuple[float, float, str]]]]:
    """Yield subtitles that are aligned together."""
    run: list[list[tuple[float, float, str]]] = []
    for line in lines:
        if run and line[-1][1] - run[0][0][0] > LONGEST_PASSAGE_S:
            yield run
            run = []
        run.append(line)
    if run:
        yield run


def _times(line: Sequence[tuple[float, float, str]], count: int) -> list[float | None]:
    """Return the start of each spoken word; unknown where writing and speech differ in number."""
    times: list[float | None] = []
    for start, _, text in line:
        spoken = len(phonemise(text))
        times += [start, *[None] * (spoken - 1)] if spoken else []
    return times if len(times) == count else [None] * count


def _misplaced(
    passage: SpokenPassage, found: Aligned, known: Sequence[float | None]
) -> list[float | None]:
    """Return by how many seconds the start of each word was misplaced."""
    firsts = np.cumsum([0, *(len(word.phones) for word in passage.words[:-1])])
    return [
        None if start is None else abs(found.phones[first].start - start)
        for first, start in zip(firsts.tolist(), known, strict=True)
    ]


def reliability(found: Sequence[Found]) -> list[Row]:
    """Return for each step of confidence how many words were within `WITHIN_S`.

    Parameters
    ----------
    found : sequence of (float, float or None)
        Confidence and error in seconds of words.

    Examples
    --------
    >>> reliability([(0.96, 0.01), (0.955, 0.4), (0.999, None)])[0]["right"]
    0.5
    """
    known = [(sure, error) for sure, error in found if error is not None]
    rows: list[Row] = []
    steps = [(low, high, f"{low:g} to {high:g}") for low, high in itertools.pairwise(_EDGES)]
    for low, high, name in [*steps, (CERTAIN, 1.0, "certain")]:
        part = [(s, e) for s, e in known if low <= s < high or s == high == 1.0]
        if part:
            rows.append(
                {
                    "confidence": name,
                    "words": len(part),
                    "share": round(len(part) / len(known), 3),
                    "told": round(float(np.mean([s for s, _ in part])), 4),
                    "right": round(float(np.mean([e <= WITHIN_S for _, e in part])), 4),
                }
            )
    return rows


def plot(results: list[Row], figure: Any) -> None:
    """Draw the reliability: share right against confidence."""
    rows = [row for row in results if "told" in row and row["confidence"] != "certain"]
    axes = figure.subplots()
    axes.plot([0.4, 1], [0.4, 1], "k:", label="as told")
    axes.plot([row["told"] for row in rows], [row["right"] for row in rows], "o-", label="measured")
    for row in rows:
        axes.annotate(str(row["words"]), (row["told"], row["right"]))
    axes.set_xlabel("confidence told")
    axes.set_ylabel(f"share of words within {1e3 * WITHIN_S:.0f} ms")
    axes.legend()
