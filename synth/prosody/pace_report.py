"""What became of each subtitle on the cuer's clock: her pace and lag, and what she left out."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.score import Phone
from synth.prosody.pacing import PacedWord
from synth.subtitles import Subtitle

HARDEST_KEYS = 6.0
"""Keys a second above which less than half of the time of a key is left to see it."""

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
    """

    subtitle: Subtitle | None
    words: list[str] = field(default_factory=list)
    mute: int = 0
    lag_s: float = 0.0
    phones: list[Phone] = field(default_factory=list)

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
        if not word.phones:
            now.words.append(source.word.text)
        elif source.subtitle is not None:
            now.lag_s = max(now.lag_s, word.lag_s)

    def report(self) -> dict[str, Any]:
        """Return the pace of everything heard, and that of every subtitle."""
        self._close()
        rows = self._rows
        return {
            "keys_per_s": max((row["keys_per_s"] for row in rows), default=0.0),
            "lag_s": max((row["lag_s"] for row in rows), default=0.0),
            "words_left_out": sum(len(row["left_out"]) for row in rows),
            "mute_e_left_out": sum(row["mute_e"] for row in rows),
            "subtitles": rows,
        }

    def __str__(self) -> str:
        """Return one line for the reader of the command line."""
        report = self.report()
        return (
            f"pace: up to {report['keys_per_s']:.1f} keys/s in a subtitle, at most "
            f"{report['lag_s']:.2f} s behind, {report['words_left_out']} words and "
            f"{report['mute_e_left_out']} mute e left out"
        )

    def _close(self) -> None:
        now, self._current = self._current, None
        if now is None:
            return
        count, rate = now.rate(self._options)
        rate = rate if count >= _FEWEST_KEYS else 0.0
        start_s = now.subtitle.start_s if now.subtitle else 0.0
        line = now.subtitle.line if now.subtitle else 1
        self._rows.append(
            {
                "start": start_s, "line": line, "keys": count, "keys_per_s": round(rate, 2),
                "lag_s": round(now.lag_s, 3), "left_out": now.words, "mute_e": now.mute,
                "readable": rate <= HARDEST_KEYS and not now.words,
            }
        )  # fmt: skip
        where = f"subtitle at {start_s:.2f} s (line {line})"
        if now.words:
            self._warn(f"{where}: no time for {len(now.words)} words: {' '.join(now.words)}")
        if rate > HARDEST_KEYS:
            self._warn(f"{where}: {rate:.1f} keys/s cannot be read, {HARDEST_KEYS:g} can")
