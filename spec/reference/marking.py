"""A sender of sound from sections 2 to 6 and 10 of spec/audio-carrier.md, in numpy.

Samples at 48 kHz and payloads in, marked samples out: one level, no loudness control, and nothing
of what an embedder MAY do. For vectors.
"""

import math
from collections.abc import Sequence

import numpy as np

from spec.reference import audio_carrier as carrier
from spec.reference.hearing_view import (
    BINS,
    FRAMES,
    HOP,
    WINDOW,
    Array,
    Cells,
    Layout,
    layout,
    spectra,
    units,
)

ALPHA = {
    "robust": (0.65, 0.35),
    "standard": (0.6, 0.6),
    "high": (0.65, 0.65),
    "discreet": (0.6, 0.6),
}
"""(W39) Part of the error that is removed, from the lowest cell to the highest."""
ROUNDS = 3
"""(W21) Rounds in which the units of the marked sound are found."""


def synthesised(changes: Array) -> Array:
    """(W9) Return the samples of changed coefficients, shape (frames, 480)."""
    n, k = np.arange(2 * HOP)[:, None], np.arange(BINS)[None, :]
    basis = math.sqrt(2 / HOP) * np.cos(np.pi / HOP * (n + 240.5) * (k + 0.5))
    frames = changes @ basis.T * WINDOW
    out = np.zeros(HOP * (len(changes) + 1))
    for t, frame in enumerate(frames):
        out[HOP * t : HOP * (t + 2)] += frame
    return out


def moved(x: Array, unit: Array, cells: Cells, step: float, bits: Array, alpha: Array) -> Array:
    """(W18, W19) Return by how much coefficients change, shape (frames, bins).

    `bits` are 0 or 1, or -1 where nothing is written, shape (frames, cells).
    """
    cut = slice(cells.first, cells.first + cells.signs.size)
    own, shape = unit[:, cut], (len(x), -1, cells.bins)
    alive = (own > 0).reshape(shape).all(axis=2) & (bits >= 0)
    parts = np.where(own > 0, cells.signs * x[:, cut] / np.where(own > 0, own, 1.0), 0.0)
    p = parts.reshape(shape).sum(axis=2) / math.sqrt(cells.bins)
    off = p / step - cells.dither - bits / 2
    error = step * (np.round(off) - off) * alive * alpha
    out = np.zeros_like(x)
    out[:, cut] = np.repeat(error, cells.bins, axis=1) * cells.signs * own / math.sqrt(cells.bins)
    return out


def bit_cells(shape: Layout, payload: tuple[bytes, bytes]) -> Array:
    """(W17, W29) Return the bits of the data cells of a superframe, -1 under pilots."""
    bits = carrier.encode(payload[0], 24, shape.l0_coded)
    if shape.l1:
        bits = bits + carrier.encode(payload[1], 16, len(shape.order) - shape.l0_coded)
    values = -np.ones(FRAMES * len(shape.data.dither))
    values[shape.order] = bits
    return values.reshape(FRAMES, -1)


def mark(
    sound: Array, payloads: Sequence[tuple[bytes, bytes]], *, profile: str, key: int, level: int
) -> Array:
    """Return a programme, shape (1 or 2, n), with its marks; the first superframe begins at 480."""
    shape = layout(profile, key)
    count = FRAMES * len(payloads)
    starts = HOP * np.arange(0.0, count + 1)
    data_bits = np.concatenate([bit_cells(shape, payload) for payload in payloads])
    pilot_bits = np.where(shape.expected == 0, -1.0, (1 - shape.expected) / 2)
    pilot_bits = np.tile(pilot_bits, (len(payloads), 1))
    alpha = np.linspace(*ALPHA[profile], len(shape.data.dither))
    same = len(sound) == 1 or bool((sound[0] == sound[1]).all())
    places = np.zeros(len(alpha)) if same else shape.places

    def changes(x: Array, unit: Array, place: int) -> Array:
        bits = np.where(places == place, data_bits, -1.0)
        out = moved(x, unit, shape.data, shape.step(level), bits, alpha)
        if place == 0:
            step = shape.pilot_step(level // 4)
            middle = np.full(len(shape.pilots.dither), np.mean(ALPHA[profile]))
            out += moved(x, unit, shape.pilots, step, pilot_bits, middle)
        return out

    clean = sound if len(sound) == 2 else sound[[0, 0]]
    plain = [spectra(one, starts).real[1:] for one in (clean.mean(axis=0), *clean)]
    marks = np.zeros((2, HOP * (count + 1)))
    for _ in range(ROUNDS + 1):
        now = clean.copy()
        now[:, HOP : HOP + marks.shape[1]] += marks[:, : now.shape[1] - HOP]
        seen = [units(spectra(one, starts)) for one in (now.mean(axis=0), *now)]
        parts = [changes(x, unit, n) for n, (x, unit) in enumerate(zip(plain, seen, strict=True))]
        marks = np.stack([synthesised(parts[0] + parts[n] * (not same)) for n in (1, 2)])
    marked = clean.copy()
    marked[:, HOP : HOP + marks.shape[1]] += marks[:, : marked.shape[1] - HOP]
    return marked[: len(sound)]
