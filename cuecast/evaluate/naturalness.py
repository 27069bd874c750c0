"""Naturalness of concatenated speech, as far as it can be measured: joins, pitch, durations.

In: performances of a concatenative synthesiser. Out: figures of one voice. Joins are compared with
the cuts between units that were recorded in a row: these are as the speaker said them.
"""

import itertools
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from synth.units.concatenation.concatenation import Performance
from synth.units.speech.pitch import PitchTrack, track_pitch

_FRAME_S = 0.02
"""Seconds of a frame whose spectrum is measured: four periods of a high voice."""

_AWAY_S = 0.015
"""Seconds between a cut and the middle of the frame on either side."""

_BANDS, _LOWEST_HZ, _HIGHEST_HZ = 24, 80.0, 8000.0
"""Bands of a spectrum, equally wide in mel."""

_FLOOR_DB = -70.0
"""Least level of bands that count, in dB of full scale."""

_MOST_CHANGE = 1.5
"""Factor on a duration beyond which a part counts as stretched."""


class NaturalnessTally:
    """Sums over performances; `row` gives the figures."""

    def __init__(self) -> None:
        self._spectrum: tuple[list[float], list[float]] = ([], [])
        self._pitch: tuple[list[float], list[float]] = ([], [])
        self._changes: list[float] = []
        self._spoken_s = 0.0

    def add(self, performances: Iterable[Performance]) -> NDArray[np.float32]:
        """Add one utterance; return its sound.

        Parameters
        ----------
        performances : iterable of Performance
            Of one score, in a row, from time 0 on.
        """
        parts = list(performances)
        sound, fs = np.concatenate([part.sound for part in parts]), parts[0].fs
        units = [unit for part in parts for unit in part.units]
        track = track_pitch(sound, fs)
        for unit in units:
            own, made = np.array(unit.source.parts_s), np.array(unit.target.parts_s)
            self._changes += np.log(np.maximum(made, 1e-3) / np.maximum(own, 1e-3)).tolist()
            self._spoken_s += float(made.sum())
        for before, after in itertools.pairwise(units):
            at_s = after.target.edges_s[0]
            if at_s - before.target.edges_s[-1] > 1e-6:
                continue
            inside = int(after.follows(before))
            one, other = (_spectrum(sound, fs, at_s + way * _AWAY_S) for way in (-1, 1))
            self._spectrum[inside].append(float(np.sqrt(np.mean((one - other) ** 2))))
            step = _pitch_step(track, at_s)
            if step >= 0:
                self._pitch[inside].append(step)
        return sound

    def row(self) -> dict[str, Any]:
        """Return the figures; of pairs the first is at joins, the second where none is."""
        changes = np.array(self._changes)
        most = np.log(_MOST_CHANGE)
        return {
            "joins_per_second": round(len(self._spectrum[0]) / max(self._spoken_s, 1e-9), 2),
            "spectrum_step_db": [_mean(values) for values in self._spectrum],
            "pitch_step_semitones": [_mean(values) for values in self._pitch],
            "duration_change": round(float(changes.std()), 3) if len(changes) else 0.0,
            "stretched": round(float((np.abs(changes) > most).mean()), 3) if len(changes) else 0.0,
        }


def _mean(values: list[float]) -> float:
    return round(float(np.mean(values)), 2) if values else 0.0


def _spectrum(sound: NDArray[np.float32], fs: int, at_s: float) -> NDArray[np.float64]:
    """Return band levels in dB around their mean."""
    width = round(_FRAME_S * fs)
    first = int(np.clip(round(at_s * fs) - width // 2, 0, max(len(sound) - width, 0)))
    power = np.abs(np.fft.rfft(sound[first : first + width] * np.hanning(width))) ** 2 / width
    mel = 2595 * np.log10(1 + np.fft.rfftfreq(width, 1 / fs) / 700)
    low, high = (2595 * np.log10(1 + hz / 700) for hz in (_LOWEST_HZ, _HIGHEST_HZ))
    band = ((mel - low) / (high - low) * _BANDS).astype(np.int64)
    inside = (mel >= low) & (band < _BANDS)
    count = np.maximum(np.bincount(band[inside], minlength=_BANDS), 1)
    level = np.bincount(band[inside], power[inside], minlength=_BANDS) / count
    level_db = 10 * np.log10(level + 10 ** (_FLOOR_DB / 10))
    return np.asarray(level_db - level_db.mean())


def _pitch_step(track: PitchTrack, at_s: float) -> float:
    """Return the semitones between both sides of a cut, -1 where one has no pitch."""
    frames = np.rint((at_s + np.array([-_AWAY_S, _AWAY_S])) / track.hop_s).astype(np.int64)
    if frames[0] < 0 or frames[1] >= len(track.f0):
        return -1.0
    one, other = track.f0[frames]
    return float(abs(12 * np.log2(other / one))) if one > 0 and other > 0 else -1.0
