"""The stage that a programme's sound passes on its way through `dub`.

Samples in, the same number of marked samples out; beside that it counts and grades them.
Sounds above 48 kHz are marked at 48 kHz: only the mark is brought to their rate and added, so
that the programme itself is never resampled.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from receiver.media.programme import SoundFormat
from watermark.audio.embed.codec_loop import CodecLoop
from watermark.audio.embed.embedder import AudioEmbedder, Source
from watermark.audio.embed.report import SuperframeMargin
from watermark.audio.signal.mix import RATES
from watermark.link.superframe import SUPERFRAME_S
from watermark.quality.resample import Resampler

_MARKED_RATE = 48_000
"""Rate in Hz to which sound of other rates is converted."""

Samples = NDArray[np.float32]


class MarkingStage:
    """Marks the sound of one programme.

    Parameters
    ----------
    sound : SoundFormat
        Rate and channels of the programme.
    source : callable
        Gives the payloads of superframe k.
    name : str
        What error messages call the programme.
    profile : str
        Name of the carrier's profile.
    key : int
        Key of the watermark.
    grade : float, optional
        Objective difference grade (ITU-R BS.1387) that the mark aims at, if not the profile's own.
    graded : bool
        Whether to report the grade that the embedder's meter gives.
    rehearsal : CodecLoop, optional
        See `AudioEmbedder`.

    Raises
    ------
    CueError
        If a sound of this rate and these channels cannot be marked.
    """

    def __init__(
        self, sound: SoundFormat, source: Source, *, name: str, profile: str = "standard",
        key: int = 0, grade: float | None = None, graded: bool = True,
        rehearsal: CodecLoop | None = None,
    ) -> None:  # fmt: skip
        if sound.fs < min(RATES):
            raise CueError(
                f"{name}: sound of {sound.fs} Hz cannot carry a cuer, at least {min(RATES)} Hz can"
            )
        self._name = name
        self._fs = sound.fs
        rate = sound.fs if sound.fs in RATES else _MARKED_RATE
        try:
            self._embedder = AudioEmbedder(
                rate,
                sound.channels,
                source,
                profile=profile,
                key=key,
                grade=grade,
                rehearsal=rehearsal,
            )
        except CueError as error:
            raise CueError(f"{name}: {error}") from error
        self._marker: Any = self._embedder
        if rate != sound.fs:
            self._marker = _AboveRate(self._embedder, sound.fs, sound.channels)
        self._graded = graded

    def process(self, block: Samples) -> Samples:
        """Take samples (n, channels); give those that are finished."""
        return np.asarray(self._marker.process(block), np.float32)

    def flush(self) -> Samples:
        """Give the rest.

        Raises
        ------
        CueError
            If nothing of the programme could carry anything.
        """
        rest = self._marker.flush()
        report = self._embedder.report()
        if report.duration_s < SUPERFRAME_S:
            raise CueError(
                f"{self._name}: sound of {report.duration_s:.2f} s is too short to carry a cuer, "
                f"one superframe lasts {SUPERFRAME_S} s"
            )
        if report.superframes == 0:
            raise CueError(f"{self._name}: the sound is silent and cannot carry a cuer")
        return np.asarray(rest, np.float32)

    def report(self) -> dict[str, Any]:
        """Return the figures of the carrier, as they stand in the report of ``dub``."""
        report = self._embedder.report()
        figures: dict[str, Any] = {
            "net_bps": round(report.net_bps, 1),
            "gross_bps": round(report.gross_bps, 1),
            "snr_db": None if report.snr_db is None else round(report.snr_db, 2),
            "silent_s": [[round(a, 3), round(b, 3)] for a, b in report.silent_s],
        }
        if self._graded and report.odg is not None:
            figures["odg"] = round(report.odg, 3)
        return figures

    def margins(self) -> tuple[SuperframeMargin, ...]:
        """Return the margins by the rehearsal, see `AudioEmbedder.margins`."""
        return self._embedder.margins()

    @property
    def superframes(self) -> int:
        """Superframes written so far into sound that can carry them."""
        return self._embedder.report().superframes


class _AboveRate:
    """Marks a sound of a higher rate than the embedder's through the difference that it makes."""

    def __init__(self, embedder: AudioEmbedder, fs: int, channels: int) -> None:
        self._embedder = embedder
        self._down = Resampler(fs, _MARKED_RATE, channels)
        self._up = Resampler(_MARKED_RATE, fs, channels)
        self._plain = np.zeros((0, channels))
        self._programme = np.zeros((0, channels), np.float32)

    def process(self, block: Samples) -> Samples:
        """Take samples (n, channels); give those that are finished."""
        self._programme = np.concatenate([self._programme, block])
        plain = self._down.process(block.astype(np.float64))
        return self._add(self._up.process(self._difference(plain, self._embedder.process)))

    def flush(self) -> Samples:
        """Give the rest."""
        tail = self._difference(self._down.flush(), self._embedder.process)
        last = self._difference(self._plain[:0], lambda _: self._embedder.flush())
        parts = [self._up.process(tail), self._up.process(last), self._up.flush()]
        mark = np.concatenate(parts)
        missing = len(self._programme) - len(mark)
        if missing > 0:
            mark = np.concatenate([mark, np.zeros((missing, mark.shape[1]))])
        return self._add(mark)

    def _difference(
        self, plain: NDArray[np.float64], change: Callable[[Samples], Samples]
    ) -> NDArray[np.float64]:
        """Return the embedder's mark, for the samples that it has finished."""
        self._plain = np.concatenate([self._plain, plain.astype(np.float32)])
        marked = change(plain.astype(np.float32))
        plain, self._plain = self._plain[: len(marked)], self._plain[len(marked) :]
        return marked - plain

    def _add(self, mark: NDArray[np.float64]) -> Samples:
        count = min(len(mark), len(self._programme))
        out = self._programme[:count] + mark[:count]
        self._programme = self._programme[count:]
        return out.astype(np.float32)
