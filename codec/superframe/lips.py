"""The lips' contract: a phone's target of the lips is drawn, whatever the residual.

Few bits leave the lips open where they should close, and pairs of phones that share a key are
distinguished by the lips alone. The receiver knows the phones: in the middle of each one the mouth
is brought near enough to the voice's viseme that no rival (another phone of the same key) is
nearer; the lips of p, b and m close, the lower lip of f and v meets the teeth. A mouth that keeps
its word is not touched.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.layout import FACE_MARKERS
from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.voice import Voice
from codec.cues.language import Language
from codec.cues.timeline import Sounding

Array = NDArray[np.float64]

FEATURES = ("aperture", "roll")
"""Upper over lower lip, and upper in front of lower lip, mm."""

_FREE = 1e3
"""Tolerance in mm where a phone demands nothing: any."""

_TOLERANCE_MM = {"p b m": (0.1, 0.3), "f v": (0.4, 0.4)}
"""How far the features may be from the viseme's; other phones do not insist on them."""

_NEAR = 0.4
"""Greatest error of a mouth, as a share of the way from its viseme to the nearest rival."""

_FARTHEST_MM, _TWINS_MM = 2.0, 0.7
"""Greatest distance allowed, and visemes too near to each other to be distinguished.

Means over the markers of the lips; twins are the a of *patte* and *pâte*.
"""

_CORE = 0.2
"""Half of a phone's core, where its contract holds whole, as a share of the phone."""

_LEAST_CORE_TICKS = 1.0
"""Least length in ticks of a phone's core, where its contract holds whole."""

_FADE_TICKS = 2.5
"""The contract begins and ends so gradually: lips move at natural speed."""

_SMALL = 1e-3
"""Weight of the parameters' size against that of the markers' displacement, mm squared."""

_LIPS = [
    FACE_MARKERS.index(name) for name in (*layout.UPPER_LIP, *layout.LOWER_LIP, *layout.LIP_CORNERS)
]


class LipContract:
    """Keeps the lips of one voice to the phones' targets.

    Parameters
    ----------
    voice : Voice
    """

    def __init__(self, voice: Voice) -> None:
        directions = voice.face.directions.astype(np.float64)
        self._lips = directions[:, _LIPS]
        self._slopes = _features(directions)
        self._still = _features(voice.face.mean.astype(np.float64)[None])[0]
        flat = directions.reshape(N_FACE_PARAMETERS, -1)
        easy = np.linalg.solve(flat @ flat.T + _SMALL * np.eye(len(flat)), self._slopes)
        self._shift = easy @ np.linalg.pinv(self._slopes.T @ easy, rcond=1e-6)
        self._visemes = voice.gestures.viseme_targets.astype(np.float64)
        self._wanted = self.features(self._visemes)
        language = voice.language
        self._tolerance = np.full((language.n_phones, len(FEATURES)), _FREE)
        for phones, tolerance in _TOLERANCE_MM.items():
            for phone in phones.split():
                if phone in language.number_of:
                    self._tolerance[language.number_of[phone]] = tolerance
        rivals = (_rivals(number, language) for number in range(language.n_phones))
        self._near = np.array([self._radius(number, found) for number, found in enumerate(rivals)])

    def features(self, face: Array) -> Array:
        """Return the features of the lips, shape (T, 2), of face parameters (T, 7), mm."""
        return np.asarray(self._still + face @ self._slopes)

    def apart(self, face: Array, viseme: Array) -> Array:
        """Return how far lips are from a viseme (7,): mean over their markers, mm, (T,)."""
        off = np.tensordot(face - viseme, self._lips, axes=1)
        return np.asarray(np.linalg.norm(off, axis=2).mean(axis=1))

    def kept(self, face: Array, line: Sequence[Sounding], ticks: Array) -> Array:
        """Return face parameters whose lips keep the contract.

        Parameters
        ----------
        face : ndarray, shape (T, 7)
            As decoded.
        line : sequence of Sounding
            Phones around these frames.
        ticks : ndarray, shape (T,)
            When the frames are, on the line's clock; ascending.
        """
        due = [
            (sounding.number, *_weight(ticks, sounding.start, sounding.end))
            for sounding in line
            if sounding.number and not sounding.open_start and not sounding.open_end
        ]
        total = np.zeros((len(ticks), 1))
        for _, held, weight in due:
            total[held, 0] += weight
        if not total.any():
            return face
        total = np.maximum(total, 1.0)
        shift = np.zeros_like(face)
        for number, held, weight in due:
            far = self.apart(face[held], self._visemes[number])
            part = weight * np.maximum(1.0 - self._near[number] / np.maximum(far, 1e-9), 0.0)
            shift[held] += part[:, None] * (self._visemes[number] - face[held])
        # First towards the viseme, where the lips are too far from it; then only as far as a
        # feature, such as the opening, is outside its tolerance.
        nearer = face + shift / total
        have = self.features(nearer)
        shift = np.zeros_like(have)
        for number, held, weight in due:
            off, free = have[held] - self._wanted[number], self._tolerance[number]
            shift[held] -= weight[:, None] * (off - np.clip(off, -free, free))
        return np.asarray(nearer + (shift / total) @ self._shift.T)

    def _radius(self, number: int, rivals: list[int]) -> float:
        """Return how far the lips may be from a phone's viseme, mm."""
        apart = self.apart(self._visemes[rivals], self._visemes[number])
        apart = apart[apart > _TWINS_MM]
        return min(_NEAR * float(apart.min()), _FARTHEST_MM) if len(apart) else _FARTHEST_MM


def _rivals(number: int, language: Language) -> list[int]:
    """Return the phones that only the lips distinguish from one."""
    phone = language.phones[number]
    for table in (dict[str, object](language.shapes), dict[str, object](language.placement_of)):
        if phone in table:
            alike = (p for p in table if table[p] == table[phone] and p != phone)
            return [language.number_of[p] for p in alike]
    return []


def _weight(ticks: Array, start: int, end: int) -> tuple[slice, Array]:
    """Return the ticks at which a phone's contract holds, and how much, 1 in its middle."""
    middle, half = 0.5 * (start + end), 0.5 * (end - start)
    core = max(2 * _CORE * half, min(_LEAST_CORE_TICKS, half))
    reach = core + _FADE_TICKS
    held = slice(*np.searchsorted(ticks, (middle - reach, middle + reach)).tolist())
    away = np.clip((np.abs(ticks[held] - middle) - core) / _FADE_TICKS, 0.0, 1.0)
    return held, np.asarray(0.5 + 0.5 * np.cos(np.pi * away))


def _features(points: Array) -> Array:
    """Return the features of markers (N, 63, 3), shape (N, 2): they are linear in them."""
    upper, lower = (points[:, FACE_MARKERS.index(name)] for name in ("UL0", "LL0"))
    return (upper - lower)[:, 1:]
