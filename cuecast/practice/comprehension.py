"""Two minutes with questions: a passage by subtitles, by the cuer, or by both; no sound.

The built-in passages are three texts with six questions each; a folder of files of the same form
replaces them. Conditions and passages are paired by a Latin square over participants, so that
every passage meets every condition equally often.
"""

import itertools
import json
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Score
from codec.errors import CueError
from cuecast.command.arguments import REST_S
from cuecast.practice.trial import ItemCondition, Step, Trial, save_item, write_trial
from synth.motion.rules.performance import motion_of
from synth.planning.prosody.pacing import Pace
from synth.planning.scoring.text_score import Reading, score_of_text

SOURCES = ("subtitles", "cuer", "both")

_BREATH_S = 0.6
"""Silence between sentences."""

_MOST_BYTES = 1 << 20
"""Bytes of a passage at most."""


def prepare(
    folder: Path,
    voice_name: str,
    *,
    passages: Path | None = None,
    display: str = "avatar",
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Trial:
    """Make the items of a test and write it into a folder that exists.

    Parameters
    ----------
    folder : Path
    voice_name : str
    passages : Path, optional
        Folder of passages (``*.json``: title, sentences, questions with choices and the index of
        the right one); default: those that come with the toolkit.
    display : str
        ``avatar`` or ``points``.
    seed : int
    progress : callable

    Raises
    ------
    CueError
        If there are no passages, or one is malformed.
    """
    voice = load_voice(voice_name)
    root = files("cuecast") / "practice" / "passages" if passages is None else passages
    texts = sorted(
        (one for one in root.iterdir() if one.name.endswith(".json")), key=lambda one: one.name
    )
    if len(texts) < len(SOURCES):
        raise CueError(f"{root}: {len(texts)} passages (*.json), {len(SOURCES)} are needed")
    pool = []
    for number, path in enumerate(texts):
        with path.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
        pool.append(_entry(folder, number, _checked(data, path.name), voice, seed))
        progress(number + 1, len(texts))
    trial = Trial(folder, "comprehension", voice_name, seed, {"display": display}, pool)
    write_trial(trial)
    return trial


def _checked(data: bytes, name: str) -> dict[str, Any]:
    """Return a passage, if it is one."""
    try:
        if len(data) > _MOST_BYTES:
            raise ValueError(f"larger than {_MOST_BYTES} bytes")
        found = json.loads(data)
        sentences = [str(text) for text in found["sentences"]]
        questions: list[dict[str, Any]] = [
            {
                "text": str(one["text"]),
                "choices": [str(text) for text in one["choices"]],
                "right": int(one["right"]),
            }
            for one in found["questions"]
        ]
        if not sentences or not questions:
            raise ValueError("no sentences or no questions")
        for one in questions:
            if not 0 <= one["right"] < len(one["choices"]) or len(one["choices"]) < 2:
                raise ValueError(f"question {one['text']!r}: no right answer among its choices")
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise CueError(f"{name}: not a passage: {error}") from error
    return {"title": str(found.get("title", name)), "sentences": sentences, "questions": questions}


def _entry(
    folder: Path, number: int, passage: dict[str, Any], voice: Voice, seed: int
) -> dict[str, Any]:
    score, captions = timed(passage["sentences"])
    motion = motion_of(score, voice, seed=seed)
    return {
        "title": passage["title"],
        "motion": save_item(folder, f"{number:02}", motion),
        "captions": captions,
        "questions": passage["questions"],
    }


def timed(sentences: list[str]) -> tuple[Score, list[tuple[float, float, str]]]:
    """Return the score of sentences at a readable pace, and their captions with its times.

    Raises
    ------
    CueError
        If nothing is spoken in one of them.

    Examples
    --------
    >>> score, captions = timed(["Il pleut.", "Tant mieux."])
    >>> len(captions), captions[1][0] > captions[0][1]
    (2, True)
    """
    reading = Reading(pace=Pace())
    parts, captions, at = [], [], REST_S
    for text in sentences:
        part = score_of_text(text, start_s=REST_S, reading=reading).shifted(at - REST_S)
        if not part.phones:
            raise CueError(f"nothing is spoken in {text!r}")
        parts.append(part)
        start, end = part.phones[0].start, part.phones[-1].end
        captions.append((round(start, 2), round(end + 0.3, 2), text))
        at = end + _BREATH_S
    phones = itertools.chain.from_iterable(part.phones for part in parts)
    keys = itertools.chain.from_iterable(part.keys for part in parts)
    return Score(tuple(phones), tuple(keys)), captions


def steps(trial: Trial, number: int) -> list[Step]:
    """Return a participant's passages, each followed by its questions."""
    found: list[Step] = []
    rng = trial.rng(number)
    chosen = [trial.pool[(number - 1 + i) % len(trial.pool)] for i in range(len(SOURCES))]
    # A row of the square: which passage meets which condition; then the order on the screen.
    row = (number - 1) // len(trial.pool)
    sources = [SOURCES[(i + row) % len(SOURCES)] for i in range(len(SOURCES))]
    for i in rng.permutation(len(SOURCES)):
        entry, source = chosen[i], sources[i]
        seen = source != "subtitles"
        condition = ItemCondition(
            display=trial.settings["display"] if seen else "none", source=source
        )
        captions = tuple((float(a), float(b), str(c)) for a, b, c in entry["captions"])
        found.append(
            Step(
                entry["title"],
                condition,
                motion=entry["motion"],
                captions=captions if source != "cuer" else (),
            )
        )
        for question in entry["questions"]:
            order = rng.permutation(len(question["choices"])).tolist()
            found.append(
                Step(
                    entry["title"],
                    condition,
                    prompt=question["text"],
                    choices=tuple(question["choices"][k] for k in order),
                    target=order.index(question["right"]),
                )
            )
    return found
