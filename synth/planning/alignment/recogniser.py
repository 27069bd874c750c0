"""Phone recogniser: the likelihood of each phone in each hundredth of a second.

The ear is the lower part of the encoder of Whisper (A. Radford and others 2022, base, MIT licence):
two convolutions and four blocks of attention that learnt from speech of many people, rooms and
noises. One layer of ours on top predicts the phones of French; it learnt from recorded speech
(`lab.recogniser.train`). Everything here is numpy.
"""

import functools
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PHONES
from codec.errors import CueError
from codec.files.npz import read_arrays
from synth.planning.alignment.sustained import without_lasting

Array = NDArray[np.float32]

EAR_ASSET = Path(__file__).parents[2] / "assets" / "ear.npz"
PHONES_ASSET = Path(__file__).parents[2] / "assets" / "heard_phones.npz"

FS = 16_000
"""Rate in Hz at which sound is heard."""

HOP = 160
"""Samples between frames: 10 ms."""

FRAME_RATE = FS / HOP

BLOCKS = 4
"""Blocks of attention, of six: the fourth distinguishes phones as well as the last (in 14
recordings of other speakers 64.4 % of the frames against 64.8 %), the third less well (61.5 %)."""

HEADS = 8
"""Heads of attention of Whisper base."""

_WINDOW, _BANDS = 400, 80
"""Samples of a frame, and mel bands, of Whisper."""

_EVERY = 2
"""The second convolution halves the rate of frames."""

_CHUNK_S, _OVERLAP_S = 20, 1
"""Seconds that are heard at once, and extra seconds on either side: Whisper takes 30."""

_MAX_ASSET_BYTES = 40_000_000
"""Bytes of each asset, unpacked, at most."""

_LEVEL = 0.05
"""Strength to which each sound is brought, of full scale 1."""

_GELU_SLOPE, _GELU_CUBE = 0.7978845608, 0.044715
"""Of the tanh form of the Gaussian error unit (D. Hendrycks, K. Gimpel 2016)."""

_SLANEY_LINEAR_HZ, _SLANEY_CORNER_HZ, _SLANEY_RATIO = 200 / 3, 1000.0, np.log(6.4) / 27
"""Mel scale of M. Slaney 1998: linear below the corner, logarithmic above it."""


@functools.cache
def load_phones() -> tuple[Array, Array]:
    """Return the layer of phones: weights of shape (512, 38) and offsets of shape (38,).

    Raises
    ------
    CueError
        If the asset is damaged.
    """
    found = read_arrays(PHONES_ASSET, max_bytes=_MAX_ASSET_BYTES)
    if found.keys() != {"weights", "offsets"} or found["offsets"].shape != (len(PHONES),):
        raise CueError(f"{PHONES_ASSET.name}: not the phones of this package")
    return found["weights"], found["offsets"]


@functools.cache
def load_ear() -> Mapping[str, Array]:
    """Return the weights of the ear, from whole numbers with a scale for each row.

    Raises
    ------
    CueError
        If the asset is damaged.
    """
    packed = read_arrays(EAR_ASSET, max_bytes=_MAX_ASSET_BYTES)
    weights = {}
    for name, array in packed.items():
        if not name.endswith(".scale"):
            weights[name] = array.astype(np.float32)
            if array.ndim > 1:
                weights[name] *= packed[f"{name}.scale"][:, None]
    return weights


def heard(x: NDArray[np.float64]) -> Array:
    """Return how likely each phone is in each frame of a sound.

    Parameters
    ----------
    x : ndarray of float64, shape (n,)
        Sound at `FS`.

    Returns
    -------
    ndarray of float32, shape (n // HOP + 1, 38)
        Logarithm of the likelihood by phone number, up to a constant of the frame; frame t stands
        for the sound around sample t * HOP.

    Examples
    --------
    >>> heard(np.zeros(1600)).shape
    (11, 38)
    """
    return likely(listen(x, load_ear()), len(x))


def likely(features: Array, samples: int) -> Array:
    """Return the result of `heard` from that of `listen` for `samples` samples."""
    weights, offsets = load_phones()
    rough = features @ weights + offsets
    place = np.arange(samples // HOP + 1) / _EVERY
    before = np.minimum(place.astype(np.int64), len(rough) - 1)
    after = np.minimum(before + 1, len(rough) - 1)
    part = (place - place.astype(np.int64)).astype(np.float32)[:, None]
    return np.asarray(rough[before] * (1 - part) + rough[after] * part)


def listen(x: NDArray[np.float64], ear: Mapping[str, Array]) -> Array:
    """Return the ear's features of a sound of any length, 50 a second, shape (frames, 512)."""
    x = without_lasting(np.pad(x, (0, max(0, _WINDOW - len(x)))))
    loud = (x / (x.std() + 1e-9) * _LEVEL).astype(np.float32)
    chunk, overlap, step = _CHUNK_S * FS, _OVERLAP_S * FS, _EVERY * HOP
    parts = []
    for first in range(0, max(1, len(loud)), chunk):
        start = max(0, first - overlap)
        features = _encoded(loud[start : first + chunk + overlap], ear)
        skipped = (first - start) // step
        parts.append(features[skipped : skipped + chunk // step])
    return np.concatenate(parts)


def _encoded(x: Array, ear: Mapping[str, Array]) -> Array:
    h = _convolved(_log_mel(x), ear, "conv1", 1)
    h = _convolved(h, ear, "conv2", _EVERY)
    h = h + _positions(*h.shape)
    for block in range(BLOCKS):
        h = h + _attended(_normal(h, ear, f"{block}.attention"), ear, f"{block}.attention")
        inner = _gelu(_linear(_normal(h, ear, f"{block}.feed"), ear, f"{block}.feed.in"))
        h = h + _linear(inner, ear, f"{block}.feed.out")
    return h


def _log_mel(x: Array) -> Array:
    """Return the logarithm of mel energies as Whisper takes them, shape (frames, 80)."""
    reach = _WINDOW // 2
    padded = np.pad(np.pad(x, (0, max(0, _WINDOW - len(x)))), reach, mode="reflect")
    frames = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW)[::HOP]
    power = np.abs(np.fft.rfft(frames * np.hanning(_WINDOW + 1)[:_WINDOW])) ** 2
    mel = np.log10(np.maximum(power @ _mel_bank().T, 1e-10))
    return np.asarray((np.maximum(mel, mel.max() - 8) + 4) / 4, dtype=np.float32)


@functools.cache
def _mel_bank() -> NDArray[np.float64]:
    """Return triangular bands of equal area, shape (bands, bins)."""
    corner = _SLANEY_CORNER_HZ / _SLANEY_LINEAR_HZ
    top = corner + np.log(FS / 2 / _SLANEY_CORNER_HZ) / _SLANEY_RATIO
    mel = np.linspace(0, top, _BANDS + 2)
    high = _SLANEY_CORNER_HZ * np.exp(_SLANEY_RATIO * (mel - corner))
    edges = np.where(mel < corner, _SLANEY_LINEAR_HZ * mel, high)
    bins = np.fft.rfftfreq(_WINDOW, 1 / FS)
    rising = (bins - edges[:-2, None]) / np.diff(edges)[:-1, None]
    falling = (edges[2:, None] - bins) / np.diff(edges)[1:, None]
    area = 2 / (edges[2:] - edges[:-2])
    return np.asarray(np.maximum(0, np.minimum(rising, falling)) * area[:, None])


@functools.cache
def _positions(frames: int, size: int) -> Array:
    """Return the sines and cosines of each frame's position, shape (frames, size)."""
    rates = np.exp(-np.log(10_000) / (size // 2 - 1) * np.arange(size // 2))
    angles = np.arange(frames)[:, None] * rates
    return np.asarray(np.hstack([np.sin(angles), np.cos(angles)]), dtype=np.float32)


def _convolved(x: Array, ear: Mapping[str, Array], name: str, stride: int) -> Array:
    """Return a convolution over three frames; the weights are (outputs, 3 * inputs)."""
    padded = np.pad(x, ((1, 1), (0, 0)))
    count = (len(x) - 1) // stride + 1
    taps = [padded[tap : tap + stride * (count - 1) + 1 : stride] for tap in range(3)]
    return _gelu(_linear(np.hstack(taps), ear, name))


def _linear(x: Array, ear: Mapping[str, Array], name: str) -> Array:
    return np.asarray(x @ ear[f"{name}.weight"].T + ear[f"{name}.bias"])


def _normal(x: Array, ear: Mapping[str, Array], name: str) -> Array:
    away = x - x.mean(axis=1, keepdims=True)
    spread = np.sqrt((away**2).mean(axis=1, keepdims=True) + np.float32(1e-5))
    return np.asarray(away / spread * ear[f"{name}.gain"] + ear[f"{name}.shift"])


def _attended(x: Array, ear: Mapping[str, Array], name: str) -> Array:
    size = x.shape[1] // HEADS
    mixed = _linear(x, ear, f"{name}.in")
    seen = np.empty_like(x)
    for head in range(HEADS):
        asked, offered, said = (
            mixed[:, size * (head + part * HEADS) :][:, :size] for part in range(3)
        )
        weights = asked @ offered.T / np.float32(np.sqrt(size))
        weights -= weights.max(axis=1, keepdims=True)
        np.exp(weights, out=weights)
        weights /= weights.sum(axis=1, keepdims=True)
        seen[:, size * head : size * (head + 1)] = weights @ said
    return _linear(seen, ear, f"{name}.out")


def _gelu(x: Array) -> Array:
    cubed = x * x
    cubed *= np.float32(_GELU_CUBE)
    cubed += 1
    cubed *= x
    cubed *= np.float32(_GELU_SLOPE)
    np.tanh(cubed, out=cubed)
    cubed += 1
    cubed *= x
    cubed *= np.float32(0.5)
    return cubed
