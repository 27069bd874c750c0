"""Superframes as spec/hearing.md reads them: layout, spectra and units, soft values, fits.

Written from that text and spec/audio-carrier.md, in numpy: samples at 48 kHz in, soft values out.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from spec.reference import audio_carrier as carrier

Array = NDArray[np.float64]
HOP, FRAMES, BINS = 480, 64, 480
LENGTH = FRAMES * HOP
SLOT_FIRST, SLOT_BINS, SLOTS = 6, 8, 6
LOWEST_TIER = {"robust": 1, "standard": 0, "high": 0, "discreet": 0}
"""(W39) Their column `tier`."""
TAPS = 32
"""(A1) Samples to either side of which a converted sample is made."""


@dataclass(frozen=True)
class Cells:
    """Cells side by side: signs of their bins, dither of each."""

    first: int
    bins: int
    signs: Array
    dither: Array


@dataclass(frozen=True)
class Layout:
    """(W13 to W17, W43) Where a profile's cells are, and where each stands: 0 mid, 1, 2."""

    name: str
    pilots: Cells
    expected: Array
    data: Cells
    places: Array
    order: NDArray[np.int64]
    l0: int
    l1: int
    l0_coded: int
    strength: float

    def step(self, level: float) -> float:
        """(W20) Return the step of data at a level."""
        return self.strength * 2 ** (1.5 + level / 4)

    def pilot_step(self, tier: float) -> float:
        """(W20) Return the step of pilots at a tier of four levels."""
        return 2 ** (1.875 + LOWEST_TIER[self.name] + tier)


@lru_cache(maxsize=8)
def layout(name: str, key: int) -> Layout:
    """Return the layout of a profile."""
    number, bins, first, last, strength, l0, l1, l0_coded = carrier.PROFILES[name]
    groups = (last - first) // bins
    slots = carrier.pilot_slots(key)
    one = carrier.signs("pilot bits", key, FRAMES)
    two = carrier.signs(f"announcement {number}", key, FRAMES)
    expected = np.zeros((FRAMES, SLOTS))
    for f in range(FRAMES):
        expected[f, slots[f][0]], expected[f, slots[f][1]] = one[f], two[f]

    def cells(purpose: str, first: int, bins: int, count: int) -> Cells:
        drawn = np.array(carrier.words(f"{purpose} dither", key, count), dtype=np.float64)
        signs = np.array(carrier.signs(f"{purpose} signs", key, count * bins), dtype=np.float64)
        return Cells(first, bins, signs, drawn / 2**32)

    period = 8 if name == "high" else 4
    lowest = first + bins * np.arange(groups)
    turn = (lowest - 30) // 4 % period
    places = np.where(turn == 0, 1, np.where(turn == period // 2, 2, 0)) * (lowest >= 30)
    order = np.array([f * groups + g for f, g in carrier.data_cells(name, key)])
    return Layout(
        name, cells("pilot", SLOT_FIRST, SLOT_BINS, SLOTS), expected,
        cells(f"data {number}", first, bins, groups), places, order, l0, l1, l0_coded, strength,
    )  # fmt: skip


@lru_cache(maxsize=1)
def mask_tables() -> tuple[NDArray[np.int64], Array]:
    """(W23 to W25) Return the edges of the bands and the spreading."""
    return np.array(carrier.bands()), np.array(carrier.spread_matrix())


WINDOW = np.sin(np.pi * (np.arange(960) + 0.5) / 960)
TWIST = np.exp(-1j * np.pi * np.arange(960) / 960)
AFTER = math.sqrt(2 / 480) * np.exp(-1j * np.pi / 480 * 240.5 * (np.arange(480) + 0.5))


def converted(sound: Array, rate: int) -> Array:
    """(A1) Return one channel at 48 kHz."""
    if rate == 48000:
        return sound
    count = len(sound) * 48000 // rate
    out = np.zeros(count)
    padded = np.concatenate([np.zeros(TAPS), sound, np.zeros(TAPS + 1)])
    for begin in range(0, count, 48000):
        time = np.arange(begin, min(begin + 48000, count)) * rate / 48000
        whole = np.floor(time).astype(np.int64)
        u = np.arange(1 - TAPS, TAPS + 1)[None, :] - (time - whole)[:, None]
        taps = np.sinc(u) * np.cos(np.pi * u / (2 * TAPS)) ** 2
        at = whole[:, None] + np.arange(1, 2 * TAPS + 1)
        out[begin : begin + len(time)] = (padded[at] * taps).sum(axis=1)
    return out


def spectra(sound: Array, starts: Array) -> NDArray[np.complex128]:
    """(W8, A2) Return the spectra of frames that begin anywhere, shape (frames, 480)."""
    whole = np.floor(starts).astype(np.int64)
    at = whole[:, None] + np.arange(960)
    inside = (at >= 0) & (at < len(sound))
    frames = np.where(inside, sound[np.clip(at, 0, len(sound) - 1)], 0.0)
    turn = np.exp(1j * np.pi / 480 * np.outer(starts - whole, np.arange(480) + 0.5))
    return np.asarray(np.fft.fft(frames * WINDOW * TWIST, axis=1)[:, :480] * AFTER * turn)


def units(found: NDArray[np.complex128]) -> Array:
    """(W24 to W28) Return the unit of each bin; the first frame serves the second one only."""
    edges, spreading = mask_tables()
    power = np.add.reduceat(np.abs(found) ** 2 / 2, edges[:-1], axis=1) / np.diff(edges)
    limit = 10**-0.6 * power
    spread = np.minimum(power @ spreading.T, limit)
    threshold = np.minimum(1e-8 * (spread / 1e-8) ** 0.7, limit)
    threshold[power < 10**-9.4] = 0.0
    limited = np.minimum(threshold[1:], 4 * np.maximum(threshold[:-1], 1e-10))
    return np.asarray(np.repeat(np.sqrt(limited), np.diff(edges), axis=1))


@dataclass(frozen=True)
class View:
    """A superframe of one channel at a place: spectra and units, shape (64, 480)."""

    spectra: NDArray[np.complex128]
    units: Array

    def projections(self, cells: Cells, turn: Array | None = None) -> tuple[Array, Array]:
        """(W18, W28) Return the cells' projections, and 1 or 0 for silent ones."""
        cut = slice(cells.first, cells.first + cells.signs.size)
        found = self.spectra[:, cut] if turn is None else self.spectra[:, cut] * turn[:, cut]
        unit = self.units[:, cut]
        shape = (len(found), -1, cells.bins)
        alive = (unit > 0).reshape(shape).all(axis=2)
        part = np.where(unit > 0, found.real * cells.signs / np.where(unit > 0, unit, 1.0), 0.0)
        total = part.reshape(shape).sum(axis=2) / math.sqrt(cells.bins)
        return np.asarray(total), np.asarray(alive, dtype=np.float64)


def soft(projections: tuple[Array, Array], cells: Cells, step: float) -> Array:
    """(W22) Return soft values."""
    return np.cos(2 * np.pi * (projections[0] / step - cells.dither)) * projections[1]


def views(channels: Array, position: float, ratio: float) -> list[View]:
    """(A3) Return the views of mid and, of two channels, of left and right."""
    starts = position + HOP * ratio * np.arange(-1.0, FRAMES)
    single = [spectra(channel, starts) for channel in channels]
    if len(single) == 2:
        single = [(single[0] + single[1]) / 2, *single]
    return [View(found[1:], units(found)) for found in single]


def fitted(
    view: View, cells: Cells, step: float, wanted: Array, delays: Array, drifts: Array
) -> tuple[float, float, float]:
    """(A6) Return the delay in samples, the drift as a part, and the score that fit best."""
    pivot = (FRAMES - 1) / 2
    omega = np.pi / 480 * (np.arange(480) + 0.5)
    scores = np.empty((len(delays), len(drifts)))
    for i, delay in enumerate(delays):
        for j, drift in enumerate(drifts):
            late = delay + drift * HOP * (np.arange(FRAMES) - pivot)
            values = soft(view.projections(cells, np.exp(1j * np.outer(late, omega))), cells, step)
            scores[i, j] = (wanted * values).sum()
    i, j = divmod(int(scores.argmax()), len(drifts))
    delay, drift = peak(delays, scores[:, j], i), peak(drifts, scores[i], j)
    return delay - drift * HOP * pivot, drift, float(scores[i, j])


def peak(grid: Array, values: Array, i: int) -> float:
    """Return the abscissa of the parabola through a maximum and its neighbours."""
    if not 0 < i < len(grid) - 1:
        return float(grid[i])
    below, top, above = values[i - 1 : i + 2]
    bend = below - 2 * top + above
    shift = 0.0 if bend >= 0 else 0.5 * (below - above) / bend
    return float(grid[i] + shift * (grid[i + 1] - grid[i]))


def standing(seen: list[View], shape: Layout) -> View:
    """Return the view in which each bin is that of the channel where its cell stands."""
    if len(seen) == 1:
        return seen[0]
    bins = np.zeros(480, dtype=np.int64)
    size = shape.data.bins
    for g, where in enumerate(shape.places):
        bins[shape.data.first + g * size : shape.data.first + (g + 1) * size] = where
    return View(
        np.choose(bins, np.stack([view.spectra for view in seen])),
        np.choose(bins, np.stack([view.units for view in seen])),
    )


def concentration(r: Array) -> Array:
    """(W38) Return the ratio of a soft value of 1 at a mean agreement."""
    return np.asarray(2 * r * (2 - r**2) / (1 - r**2))
