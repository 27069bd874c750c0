"""Whether viewers can read the cuer: pace, holds, speed, omissions and movement, over subtitles.

Material: the subtitles in a folder (``--clips``), or programmes of five minutes made of the
package's sentences at 4 and 6 syllables a second, pauses counted, the demonstration's text and a
news text of 15 characters a second.
Each is cued at the readable pace and in step with the speaker (``--channels readable,sync``).

A key is *held* while the hand is nearer to it than to any other key (`codec.analysis.readability`).
The *reader* stands for a viewer: a recogniser taught on slow cueing, which sees 25 pictures a
second and reads a key that stands for three of them. The movement's figures stand beside those of
real cuers (`cuecast.evaluate.strokes`).
"""

import difflib
import itertools
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.analysis.readability import HELD_S, Classes
from codec.analysis.recognise import Recogniser, fit_recogniser
from codec.cuer.voice import load_voice
from codec.cues.cueing import cue
from codec.cues.phonology import VOWELS
from codec.cues.score import PLACEMENT_NUMBER, Key, Phone, Score
from codec.errors import CueError
from cuecast.demo.content import make_sound
from cuecast.dubbing.readability import VisibilityMeter
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.strokes import RATE_HZ, REAL, film_of, rows_within, stroke_figures
from receiver.drawing.render import draw, write_picture
from synth.language.subtitles import Subtitle, read_subtitles
from synth.language.text.sentences import read_sentences
from synth.motion.measured.cuer import MEASURED, performer
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.prosody.pace_report import PaceReport
from synth.planning.prosody.pacing import READABLE, Pace
from synth.planning.prosody.simulation import PerformerChoice
from synth.planning.scoring.text_score import PLAIN, Reading, score_of_subtitles, score_of_text

PACES: dict[str, Pace | None] = {"readable": READABLE, "sync": None}

_RATES = (4.0, 6.0)
"""Syllables per second of the programmes."""

_PROGRAMMES = 3
"""Programmes of each rate."""

_PROGRAMME_S = 300.0
"""Their length in seconds."""

_GAP_S = 0.1
"""Between two subtitles of a made programme; their time is that of the syllables, gap included."""

_NEWS_CHARACTERS = 15.0
"""Characters of text a second in the news: as many as subtitles of television have at most."""

_REAL_PACE = 3.25
"""Keys a second at which movement is compared with that of real cuers."""

_EVERY, _SENTENCES = 8, 24
"""Stride in sentences, and their number, for the movement."""

_TRACKER_MM = 0.8
"""Noise of a tracker's landmarks of the hand, mm: with it the mean of the knuckles is as noisy as
that of real films (0.36 mm, from fourth differences of slow frames)."""

_FRAMES_HZ = 50.0
"""Frames per second at which keys are judged."""

_PICTURES_HZ = 25.0
"""Pictures per second that a viewer sees."""

_PICTURES = 3
"""Pictures for which a reader has to see a key: the 100 ms of `HELD_S`."""

_TAUGHT = 40
"""Sentences that the reader is taught on."""

_SLOW = 1.2
"""Pace of the sentences that teach the reader, in syllables a second."""

_STRIP_PICTURES = 12
"""Pictures of the film strip."""

_STRIP_SIZE = (240, 320)
"""Width and height of each in pixels."""

_LONG_WAYS = {("side", "chin"), ("side", "mouth"), ("side", "throat")}
"""Placements from and to which the film strip shows the hand on its way."""

_SEEN = (
    "keys_per_s",
    "most_keys_per_s",
    "held_share",
    "hold_p10_s",
    "three_pictures_share",
    "peak_m_s",
)
"""What rows say of the motion, by the meter of all reports."""

_SUBTITLES = {".srt", ".vtt", ".ttml", ".dfxp", ".xml", ".stl", ".ass", ".ssa"}


def evaluate(options: EvaluateOptions) -> list[dict[str, Any]]:
    """Return one row per programme and pace, and one of the real cuers.

    Parameters
    ----------
    options : EvaluateOptions
        ``clips`` names a folder of subtitles, ``channels`` some of `PACES`; ``out`` takes a film
        strip of the first programme.

    Raises
    ------
    CueError
        If a pace is unknown, or there are no subtitles.
    """
    paces = options.channels or tuple(PACES)
    if unknown := set(paces) - set(PACES):
        raise CueError(f"no pace called {min(unknown)!r}, there are: {', '.join(PACES)}")
    reader = taught_reader()
    rows = []
    for name, subtitles in programmes(options):
        for pace in paces:
            options.say(f"{name}, {pace}")
            rows.append(
                {"clip": name, "pace": pace} | figures(subtitles, PACES[pace], reader, options.seed)
            )
    if not rows:
        raise CueError(f"{options.clips}: no subtitles that say anything")
    if options.out is not None:
        _, subtitles = next(iter(programmes(options)))
        strip(options.out / "readability-strip.png", subtitles, options.seed)
    if options.clips is None:
        options.say("movement")
        rows += movement_rows(options.seed)
    real = {
        name: f"{low:g}-{high:g}" if low != high else f"{low:g}"
        for name, (low, high) in REAL.items()
    }
    return [*rows, {"clip": "real cuers", "pace": "their own"} | real]


def programmes(options: EvaluateOptions) -> Iterator[tuple[str, list[Subtitle]]]:
    """Yield names and subtitles of the material."""
    if options.clips is not None:
        for path in sorted(options.clips.iterdir()):
            if path.suffix.lower() in _SUBTITLES:
                yield path.name, list(read_subtitles(path))
        return
    rng = np.random.default_rng([options.seed, 31])
    lines = read_sentences()
    yield "demonstration", make_sound()[1]
    yield "news", news()
    for rate in _RATES:
        for number in range(_PROGRAMMES):
            order = rng.permutation(len(lines))
            said = [lines[i] for i in order]
            yield f"{rate:g} syllables/s, {number + 1}", spoken_at(said, rate, _PROGRAMME_S)


def news() -> list[Subtitle]:
    """Return the subtitles of a news programme: dense, without pauses."""
    text = resources.files("cuecast").joinpath("evaluate/news.txt").read_text(encoding="utf-8")
    subtitles: list[Subtitle] = []
    time_s = 1.0
    for number, line in enumerate(text.splitlines(), 1):
        length_s = len(line) / _NEWS_CHARACTERS
        subtitles.append(Subtitle(time_s, time_s + length_s - _GAP_S, line, number))
        time_s += length_s
    return subtitles


def spoken_at(lines: Sequence[str], syllables_per_s: float, length_s: float) -> list[Subtitle]:
    """Return lines as subtitles that are spoken at a rate, pauses counted, one after the other."""
    subtitles: list[Subtitle] = []
    time_s = 1.0
    for line in lines:
        syllables = sum(p in VOWELS for word in PLAIN.words(line) for p in word.phones)
        needed_s = syllables / syllables_per_s
        if time_s + needed_s > length_s:
            break
        if needed_s > 2 * _GAP_S:
            subtitles.append(Subtitle(time_s, time_s + needed_s - _GAP_S, line, len(subtitles) + 1))
            time_s += needed_s
    return subtitles


def figures(
    subtitles: Sequence[Subtitle], pace: Pace | None, reader: Recogniser, seed: int = 0
) -> dict[str, Any]:
    """Return the figures of one programme at one pace.

    ``verbatim_share`` is the share of the whole text's keys that are shown and held for
    `codec.analysis.readability.HELD_S`; ``read_share`` that of those which the reader took in.
    """
    report = PaceReport()
    reading = Reading(pace=pace, performing=PerformerChoice(seed=seed))
    score = score_of_subtitles(subtitles, reading=reading, on_word=report)
    said = [key for subtitle in subtitles for key in score_of_text(subtitle.text).keys]
    if not score.keys:
        return {"keys_said": len(said), "keys_shown": 0}
    cuer = GestureSynthesiser(rate_hz=_FRAMES_HZ, seed=seed)
    markers = _markers(cuer, score)
    seen = VisibilityMeter(Classes(cuer.targets()[0]), _FRAMES_HZ)
    seen.add(markers, 0.0, score.keys)
    found = seen.figures()
    held = np.array([item.held_s for item in seen.shown])
    report.seen(seen.shown)
    told = report.report()
    every = round(_FRAMES_HZ / _PICTURES_HZ)
    taken = read_keys(reader, markers[::every])
    return {
        "keys_said": len(said),
        "keys_shown": len(score.keys),
        "text_share": told["text_share"],
        "words_left_out": told["words_left_out"],
        "lag_s": told["lag_s"],
        "unreadable_subtitles": sum(not row["readable"] for row in told["subtitles"]),
        **{name: found[name] for name in _SEEN},
        "verbatim_share": float(np.sum(held >= HELD_S - 1e-6)) / max(len(said), 1),
        "read_share": in_common(taken, _gestures(said)),
    }


def _markers(cuer: GestureSynthesiser, score: Score) -> NDArray[np.float32]:
    frames = int(cuer.rate_hz * (score.phones[-1].end + 1.0))
    step = 1024
    return np.concatenate(
        [
            cuer.markers(score, at / cuer.rate_hz, min(step, frames - at))
            for at in range(0, frames, step)
        ]
    )


def movement_rows(seed: int = 0) -> list[dict[str, Any]]:
    """Return the movement at the pace of real cuers beside theirs: ours and the second cuer's."""
    scores = slowed(
        [score_of_text(line, start_s=1.0) for line in read_sentences()[::_EVERY][:_SENTENCES]]
    )
    rows = []
    for name, law, noise_mm in (
        ("claire", "minimum-jerk", 0.0),
        ("claire", "minimum-jerk", _TRACKER_MM),
        ("solange", MEASURED, _TRACKER_MM),
    ):
        films = [
            film_of(
                performer(name, law, rate_hz=RATE_HZ, seed=seed),
                score,
                noise_mm=noise_mm,
                seed=seed + number,
            )
            for number, score in enumerate(scores)
        ]
        figures = stroke_figures(films) | {"keys_per_s": _REAL_PACE}
        rows.append(
            {"clip": f"movement of {name}, {law}", "tracker_mm": noise_mm}
            | figures
            | {"rows_met": rows_within(figures)}
        )
    return rows


def slowed(scores: Sequence[Score], keys_per_s: float = _REAL_PACE) -> list[Score]:
    """Return scores with all lengths stretched alike, to a common rate in keys/s."""
    keys = sum(len(score.keys) for score in scores)
    spoken_s = sum(score.phones[-1].end - score.phones[0].start for score in scores)
    factor = keys / keys_per_s / spoken_s
    slow = []
    for score in scores:
        phones = tuple(Phone(p.symbol, factor * p.start, factor * p.end) for p in score.phones)
        slow.append(Score(phones, tuple(cue(phones))))
    return slow


@cache
def taught_reader() -> Recogniser:
    """Return a recogniser that has seen slow cueing."""
    slow = Reading(pace=Pace(syllables_per_s=_SLOW))
    cuer = GestureSynthesiser(rate_hz=_PICTURES_HZ, seed=41)
    frames, shapes, places = [], [], []
    for line in read_sentences()[::-1][:_TAUGHT]:
        score = score_of_text(line, start_s=1.0, reading=slow)
        markers = _markers(cuer, score)
        labels = cuer.labels(score, 0.0, len(markers))
        kept = (labels.shape >= 0) & (labels.placement >= 0)
        frames.append(markers[kept])
        shapes.append(labels.shape[kept].astype(np.int64))
        places.append(labels.placement[kept].astype(np.int64))
    return fit_recogniser(np.concatenate(frames), np.concatenate(shapes), np.concatenate(places))


def read_keys(reader: Recogniser, markers: NDArray[np.floating]) -> list[tuple[int, int]]:
    """Return the shapes and placements that stand for `_PICTURES` pictures or more, in order."""
    shapes = reader.shape_posteriors(markers).argmax(axis=1)
    places = reader.placement_posteriors(markers, shapes).argmax(axis=1)
    codes = shapes * len(PLACEMENT_NUMBER) + places
    edges = np.flatnonzero(np.diff(codes, prepend=-1, append=-1))
    taken: list[tuple[int, int]] = []
    for begin, end in itertools.pairwise(edges.tolist()):
        key = int(shapes[begin]), int(places[begin])
        if end - begin >= _PICTURES and key[1] and (not taken or taken[-1] != key):
            taken.append(key)
    return taken


def _gestures(keys: Sequence[Key]) -> list[tuple[int, int]]:
    """Return the keys that the hand has to show: repeated ones once."""
    line: list[tuple[int, int]] = []
    for key in keys:
        gesture = key.shape, PLACEMENT_NUMBER[key.placement]
        if not line or line[-1] != gesture:
            line.append(gesture)
    return line


def in_common(found: Sequence[tuple[int, int]], wanted: Sequence[tuple[int, int]]) -> float:
    """Return the share of `wanted` that `found` has in the same order.

    Examples
    --------
    >>> in_common([(1, 1), (3, 2), (2, 2)], [(1, 1), (2, 2), (5, 3)])
    0.6666666666666666
    """
    if not wanted:
        return 0.0
    matcher = difflib.SequenceMatcher(None, found, wanted, autojunk=False)
    return sum(block.size for block in matcher.get_matching_blocks()) / len(wanted)


def strip(path: Path, subtitles: Sequence[Subtitle], seed: int = 0) -> None:
    """Draw successive pictures of the cuer, 25 a second, as one PNG: from the side to the face."""
    voice = load_voice()
    reading = Reading(pace=READABLE, performing=PerformerChoice(seed=seed))
    score = score_of_subtitles(subtitles, reading=reading)
    half = itertools.pairwise(score.keys[len(score.keys) // 2 :])
    ways = (one.start for one, other in half if (one.placement, other.placement) in _LONG_WAYS)
    middle = next(ways, score.keys[len(score.keys) // 2].start)
    cuer = GestureSynthesiser(voice.name, seed=seed)
    motion = cuer.motion(score, round(middle, 2), 2 * _STRIP_PICTURES + 4, voice)
    times = motion.start_s + np.arange(_STRIP_PICTURES) / _PICTURES_HZ
    pictures = list(draw(motion, voice, times, style="avatar", size=_STRIP_SIZE))
    rows = np.split(np.array(pictures), 2)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_picture(path, np.concatenate([np.concatenate(list(row), axis=1) for row in rows]))


def plot(results: list[dict[str, Any]], figure: Any) -> None:
    """Plot the shares of the text's keys that are held, and that the reader took in."""
    rows = [row for row in results if "verbatim_share" in row]
    axes = figure.subplots()
    at = np.arange(len(rows))
    axes.barh(at - 0.2, [row["verbatim_share"] for row in rows], 0.4, label="held for 100 ms")
    axes.barh(at + 0.2, [row["read_share"] for row in rows], 0.4, label="taken in by the reader")
    axes.axvline(0.54, color="0.5", linestyle=":", label="twelve transliterators")
    axes.set_yticks(at, [f"{row['clip']}, {row['pace']}" for row in rows])
    axes.set_xlabel("share of the text's keys")
    axes.legend()
