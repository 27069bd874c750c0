"""Praat TextGrids of scores: a tier of phones and a tier of keys.

The long text format of Praat, UTF-8. A key is written as the paper prints it, placement then
shape, followed by its phones: ``24 b ɔ̃``.
"""

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from codec.cues.score import PLACEMENTS, Key, Phone, Score
from codec.errors import CueError

_INTERVAL = re.compile(
    r"xmin\s*=\s*(\S+)\s+xmax\s*=\s*(\S+)\s+text\s*=\s*\"((?:[^\"]|\"\")*)\"", re.DOTALL
)
_TIER = re.compile(r"name\s*=\s*\"((?:[^\"]|\"\")*)\"")

Interval = tuple[float, float, str]


def write_textgrid(path: str | os.PathLike[str], score: Score, duration_s: float) -> None:
    """Write `score` as a TextGrid of `duration_s` seconds.

    Raises
    ------
    CueError
        If the score starts before 0 or ends after `duration_s`.
    """
    phones = [(p.start, p.end, p.symbol) for p in score.phones]
    keys = [(k.start, k.end, " ".join([str(k), *k.phones])) for k in score.keys]
    lines = [
        'File type = "ooTextFile"', 'Object class = "TextGrid"', "",
        "xmin = 0", f"xmax = {duration_s:.6f}", "tiers? <exists>", "size = 2", "item []:",
    ]  # fmt: skip
    for number, (name, intervals) in enumerate((("phones", phones), ("keys", keys)), start=1):
        # Praat wants tiers without gaps.
        filled = list(_filled(intervals, duration_s))
        lines += [
            f"    item [{number}]:",
            '        class = "IntervalTier"',
            f'        name = "{name}"',
            "        xmin = 0",
            f"        xmax = {duration_s:.6f}",
            f"        intervals: size = {len(filled)}",
        ]
        for i, (start, end, text) in enumerate(filled, start=1):
            lines += [
                f"        intervals [{i}]:",
                f"            xmin = {start:.6f}",
                f"            xmax = {end:.6f}",
                f'            text = "{text}"',
            ]
    Path(path).write_text("\n".join([*lines, ""]), encoding="utf-8")


def _filled(intervals: Iterable[Interval], duration_s: float) -> Iterator[Interval]:
    """Yield the intervals with empty ones in their gaps, from 0 to `duration_s`."""
    at = 0.0
    for start, end, text in intervals:
        if start < at - 1e-6:
            raise CueError(f"interval {text!r} starts at {start} s, before {at} s")
        if start > at + 1e-6:
            yield at, start, ""
        yield max(start, at), end, text
        at = end
    if at > duration_s + 1e-6:
        raise CueError(f"the score ends at {at} s, after {duration_s} s")
    if at < duration_s - 1e-6:
        yield at, duration_s, ""


def read_textgrid(path: str | os.PathLike[str]) -> Score:
    """Read a TextGrid with a tier ``phones`` and, if there is one, a tier ``keys``.

    Raises
    ------
    CueError
        If the file is missing, malformed, or has no tier of phones.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CueError(f"{path}: not a TextGrid: {error}") from error
    tiers = {}
    for part in re.split(r"item\s*\[\d+\]:", text)[1:]:
        name = _TIER.search(part)
        if name:
            tiers[name.group(1)] = [m.groups() for m in _INTERVAL.finditer(part)]
    if "phones" not in tiers:
        raise CueError(f"{path}: no tier of phones in the TextGrid")
    try:
        phones = tuple(
            Phone(symbol, float(a), float(b)) for a, b, symbol in tiers["phones"] if symbol.strip()
        )
        keys = tuple(
            _key(float(a), float(b), label)
            for a, b, label in tiers.get("keys", [])
            if label.strip()
        )
    except ValueError as error:
        raise CueError(f"{path}: malformed TextGrid: {error}") from error
    return Score(phones, keys)


def _key(start: float, end: float, label: str) -> Key:
    numbers, *phones = label.split()
    if not re.fullmatch(r"[0-5][0-8]", numbers):
        raise ValueError(f"key {numbers!r} is not placement 0..5 and shape 0..8")
    return Key(start, end, tuple(phones), int(numbers[1]), PLACEMENTS[int(numbers[0])])
