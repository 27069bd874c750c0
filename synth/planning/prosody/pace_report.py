"""What became of each subtitle on the cuer's clock: her pace and lag, and what she left out."""

import bisect
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from codec.analysis.readability import Shown
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.score import Phone
from synth.language.subtitles import Subtitle
from synth.planning.prosody.pacing import PacedWord

HARDEST_KEYS = 6.0
"""Keys a second above which less than half of the time of a key is left to see it."""

THREE_PICTURES_S = 0.12
"""Seconds of a key that three of 25 pictures a second show, whenever they are taken."""

_SAME_S = 1e-6
"""Seconds within which times count as the same."""

_FEWEST_KEYS = 4
"""Fewer keys have no rate."""


@dataclass(slots=True)
class SubtitlePace:
    """What became of one subtitle, or of a text without times.

    Attributes
    ----------
    subtitle : Subtitle or None
    words : list of str
        Left out.
    mute : int
        Mute e left out.
    lag_s : float
        How far the cuer was behind the speaker at most.
    phones : list of Phone
        On the cuer's clock.
    said : list of Phone
        Of the whole text, on the programme's clock.
    """

    subtitle: Subtitle | None
    words: list[str] = field(default_factory=list)
    mute: int = 0
    lag_s: float = 0.0
    phones: list[Phone] = field(default_factory=list)
    said: list[Phone] = field(default_factory=list)

    def rate(self, options: CueingOptions) -> tuple[int, float]:
        """Return the number of keys and keys per second, pauses inside counted."""
        keys = list(cue(self.phones, options))
        length_s = self.phones[-1].end - self.phones[0].start if keys else 0.0
        return len(keys), len(keys) / length_s if length_s > 0 else 0.0


class PaceReport:
    """Listens to what becomes of words, subtitle by subtitle.

    Parameters
    ----------
    options : CueingOptions
        Where charts of the code differ.
    warn : callable, optional
        Called with one line for each subtitle that cannot be read as it is written.
    """

    def __init__(
        self,
        options: CueingOptions = DEFAULT_OPTIONS,
        warn: Callable[[str], None] = lambda line: None,
    ) -> None:
        self._options, self._warn = options, warn
        self._current: SubtitlePace | None = None
        self._rows: list[dict[str, Any]] = []

    def __call__(self, word: PacedWord) -> None:
        """Remember what became of a word."""
        source = word.source
        if self._current is None or self._current.subtitle is not source.subtitle:
            self._close()
            self._current = SubtitlePace(source.subtitle)
        now = self._current
        now.mute += word.mute
        now.phones += word.phones
        now.said += source.phones
        if not word.phones:
            now.words.append(source.word.text)
        elif source.subtitle is not None:
            now.lag_s = max(now.lag_s, word.lag_s)

    def seen(self, shown: Iterable[Shown]) -> None:
        """Count the keys of every subtitle that three pictures cannot show, and warn of them."""
        self._close()
        starts = [row["cued"][0] for row in self._rows]
        for item in shown:
            number = bisect.bisect_right(starts, item.key.start + _SAME_S) - 1
            if number >= 0 and item.held_s < THREE_PICTURES_S - _SAME_S:
                self._rows[number]["short_keys"] += 1
        for row in self._rows:
            if row["short_keys"]:
                row["readable"] = False
                self._warn(
                    f"{_where(row)}: {row['short_keys']} of {row['keys']} keys stand for less than "
                    "three pictures"
                )

    def report(self) -> dict[str, Any]:
        """Return the pace of everything heard, and that of every subtitle."""
        self._close()
        rows = self._rows
        return {
            "keys_per_s": max((row["keys_per_s"] for row in rows), default=0.0),
            "lag_s": max((row["lag_s"] for row in rows), default=0.0),
            "text_share": round(share(rows), 4),
            "words_left_out": sum(len(row["left_out"]) for row in rows),
            "mute_e_left_out": sum(row["mute_e"] for row in rows),
            "subtitles": rows,
        }

    def __str__(self) -> str:
        """Return one line for the reader of the command line."""
        report = self.report()
        rate = f"up to {report['keys_per_s']:.1f} keys/s in a subtitle, "
        return (
            f"pace: {rate if report['keys_per_s'] else ''}at most {report['lag_s']:.2f} s behind, "
            f"{100 * report['text_share']:.1f} % of the text's keys, "
            f"{report['words_left_out']} words and "
            f"{report['mute_e_left_out']} mute e left out"
        )

    def _close(self) -> None:
        now, self._current = self._current, None
        if now is None:
            return
        count, rate = now.rate(self._options)
        rate = rate if count >= _FEWEST_KEYS else 0.0
        start_s = now.subtitle.start_s if now.subtitle else 0.0
        cued = [now.phones[0].start, now.phones[-1].end] if now.phones else self._until()
        line = now.subtitle.line if now.subtitle else 1
        self._rows.append(
            {
                "start": start_s,
                "line": line,
                "keys": count,
                "keys_of_text": sum(1 for _ in cue(now.said, self._options)),
                "keys_per_s": round(rate, 2),
                "lag_s": round(now.lag_s, 3),
                "left_out": now.words,
                "mute_e": now.mute,
                "cued": cued,
                "short_keys": 0,
                "readable": rate <= HARDEST_KEYS and not now.words,
            }
        )
        where = _where(self._rows[-1])
        if now.words:
            self._warn(f"{where}: no time for {len(now.words)} words: {' '.join(now.words)}")
        if rate > HARDEST_KEYS:
            self._warn(f"{where}: {rate:.1f} keys/s cannot be read, {HARDEST_KEYS:g} can")

    def _until(self) -> list[float]:
        """Return the span of a subtitle that is left out whole."""
        end_s = self._rows[-1]["cued"][1] if self._rows else 0.0
        return [end_s, end_s]


def share(rows: list[dict[str, Any]]) -> float:
    """Return the share of the whole text's keys that is cued; 1 of no text."""
    shown, whole = (sum(row[name] for row in rows) for name in ("keys", "keys_of_text"))
    return float(shown / whole) if whole else 1.0


def _where(row: dict[str, Any]) -> str:
    return f"subtitle at {row['start']:.2f} s (line {row['line']})"
