"""A second listener, of another family than Whisper: a phone recogniser of French.

A convolutional network of the library hama (Apache-2.0; taught by others on English and Korean with
connectionist temporal classification, A. Graves and others 2006) gives the probability of some
phonetic symbols in each frame. A small network of ours maps these, together with mel bands, to the
phones of French. It learnt from one reader (`lab.recogniser.second`), none of whose sound is in any
voice of this project. The phones of a sentence are the best path through them with a bigram of
French phones (A. Viterbi 1967).
"""

import hashlib
import importlib.resources
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE, PHONE_NUMBER, PHONES
from codec.errors import CueError
from codec.files.npz import read_arrays
from cuecast.evaluate.listener import FS

Array = NDArray[np.float32]

PhoneListener = Callable[[NDArray[np.float64]], list[str]]
"""Gives the phones understood in a sound at `cuecast.evaluate.listener.FS`."""

ASSET = Path(__file__).parent / "assets" / "second_ear.npz"

FRAME_S = 0.02
"""Seconds between frames of hama's network."""

AROUND = 3
"""Frames before and after a frame that its phone is recognised from."""

MODEL_SHA256 = "a9fcfe73e179ca48e399cd76a90a6b3e1887bf5037ecc52b778d13a149563328"
"""Of the weights in hama 1.7.0: our layer has learnt from these."""

_MAX_ASSET_BYTES = 10_000_000
"""Bytes of the asset, unpacked, at most."""

_LEVEL = 0.5
"""Largest sample of a sound as it is heard, of full scale 1."""

_SHORTEST = 3200
"""Samples that are heard at least."""

_LEAST_LOG = -12.0
"""Lower logarithms of probabilities count as this."""

BANDS, _WINDOW, _HOP, _SIZE = 24, 400, 160, 512
"""Mel bands, samples of a frame, samples between frames, and length of its Fourier transform."""

_EDGES_HZ = (60.0, 7600.0)
"""Frequencies that the mel bands lie between."""

_EMPHASIS = 0.97
"""Share of the last sample that is taken from each sample."""

_LOUD, _LOUD_RANGE = 0.9, 4.5
"""Frames count as speech from this much below this quantile of their logarithmic energy on: their
mean spectrum is subtracted."""

_PRIOR_WEIGHT = 0.6
"""How much of the phones' usual shares is taken from the network's result."""

_BIGRAM_WEIGHT = 1.5
"""Weight of the bigram: of 1, 1.5 and 2 within .5 % of the least errors in recordings kept out."""

_SHORTEST_FRAMES = 2
"""Frames of a phone at least."""


def second_listener() -> PhoneListener:
    """Return a listener who knows the phones of French.

    Raises
    ------
    CueError
        If hama is not installed or has other weights, or the asset is damaged.
    """
    probabilities = load_network()
    asset = load_asset()

    def listen(x: NDArray[np.float64]) -> list[str]:
        features = frames(x, probabilities)
        chosen = features[:, asset["columns"]]
        return best_path(likelihoods(around(chosen), asset), asset["bigram"])

    return listen


def load_asset() -> Mapping[str, NDArray[np.float32]]:
    """Return the layers of the small network, and the bigram.

    Raises
    ------
    CueError
        If the asset is damaged.
    """
    found = read_arrays(ASSET, max_bytes=_MAX_ASSET_BYTES)
    if "bigram" not in found or found["bigram"].shape != (len(PHONES), len(PHONES)):
        raise CueError(f"{ASSET.name}: not the second listener of this package")
    return {k: v if v.dtype.kind == "i" else v.astype(np.float32) for k, v in found.items()}


def load_network() -> Callable[[NDArray[np.float64]], Array]:
    """Return the network of hama: logarithms of probabilities, shape (frames, symbols)."""
    try:
        from hama.asr import ASRModel
    except ImportError as error:
        raise CueError(
            "the listener needs the package hama: install cuecast[intelligibility]"
        ) from error
    weights = importlib.resources.files("hama.assets") / "asr_waveform.hama"
    digest = hashlib.sha256(weights.read_bytes()).hexdigest()
    if digest != MODEL_SHA256:
        raise CueError(f"weights of hama have SHA-256 {digest}, not {MODEL_SHA256}")
    session = ASRModel().session

    def run(x: NDArray[np.float64]) -> Array:
        sound = (x / (np.abs(x).max(initial=0.0) + 1e-9) * _LEVEL).astype(np.float32)
        given = {"waveform": sound[None], "waveform_lengths": np.array([len(sound)])}
        found, count = session.run(["log_probs", "out_lengths"], given)
        return np.asarray(found[0, : int(count[0])], dtype=np.float32)

    return run


def frames(x: NDArray[np.float64], network: Callable[[NDArray[np.float64]], Array]) -> Array:
    """Return the features of a sound at `FS`, one row each `FRAME_S` seconds."""
    x = np.pad(x, (0, max(0, _SHORTEST - len(x))))
    found = np.maximum(network(x), _LEAST_LOG)
    return np.hstack([found, _mel(x, len(found))])


def _mel(x: NDArray[np.float64], count: int) -> Array:
    """Return mel energies without the mean of speech, two frames a row, shape (count, 48)."""
    risen = np.append(x[0], x[1:] - _EMPHASIS * x[:-1])
    padded = np.pad(risen, (_WINDOW // 2, _WINDOW + 2 * _HOP))
    pieces = np.lib.stride_tricks.sliding_window_view(padded, _WINDOW)[::_HOP][: 2 * count]
    power = np.abs(np.fft.rfft(pieces * np.hamming(_WINDOW), _SIZE)) ** 2
    mel = np.log(power @ _mel_bank().T + 1e-7)
    mel = np.pad(mel, ((0, 2 * count - len(mel)), (0, 0)), mode="edge")
    energy = mel.mean(axis=1)
    mel -= mel[energy > np.quantile(energy, _LOUD) - _LOUD_RANGE].mean(axis=0)
    return mel.reshape(count, 2 * BANDS).astype(np.float32)


def _mel_bank() -> NDArray[np.float64]:
    """Return triangular bands, shape (bands, bins)."""
    low, high = (2595 * np.log10(1 + edge / 700) for edge in _EDGES_HZ)
    edges = 700 * (10 ** (np.linspace(low, high, BANDS + 2) / 2595) - 1)
    bins = np.fft.rfftfreq(_SIZE, 1 / FS)
    rising = (bins - edges[:-2, None]) / np.diff(edges)[:-1, None]
    falling = (edges[2:, None] - bins) / np.diff(edges)[1:, None]
    return np.maximum(0, np.minimum(rising, falling))


def around(features: Array) -> Array:
    """Return the features of each frame and of `AROUND` on either side, in one row."""
    padded = np.pad(features, ((AROUND, AROUND), (0, 0)), mode="edge")
    parts = [padded[first : first + len(features)] for first in range(2 * AROUND + 1)]
    return np.hstack(parts)


def likelihoods(rows: Array, layers: Mapping[str, NDArray[np.float32]]) -> Array:
    """Return how likely each phone is in each frame, in the logarithm, shape (frames, 38)."""
    h = (rows - layers["mean"]) / layers["spread"]
    for number in (0, 1):
        h = np.maximum(h @ layers[f"weights{number}"] + layers[f"offsets{number}"], 0)
    z = h @ layers["weights2"] + layers["offsets2"]
    z -= z.max(axis=1, keepdims=True)
    z -= np.log(np.exp(z).sum(axis=1, keepdims=True))
    return np.asarray(z - _PRIOR_WEIGHT * layers["prior"])


def best_path(likely: Array, bigram: Array) -> list[str]:
    """Return the likeliest phones without pauses.

    Parameters
    ----------
    likely : ndarray of float32, shape (frames, 38)
    bigram : ndarray of float32, shape (38, 38)
        Logarithm of the probability of each phone (column) after each (row).

    Examples
    --------
    >>> likely = np.full((6, 38), -9.0)
    >>> likely[[0, 1, 2, 3, 4, 5], [PHONE_NUMBER[p] for p in "aabb__"]] = 0
    >>> best_path(likely, np.zeros((38, 38)))
    ['a', 'b']
    """
    steps = _BIGRAM_WEIGHT * bigram
    every = np.arange(len(PHONES))
    score = np.full((_SHORTEST_FRAMES, len(PHONES)), -np.inf)
    score[0] = likely[0] + steps[PHONE_NUMBER[PAUSE]]
    score[:, PHONE_NUMBER[PAUSE]] = likely[0, PHONE_NUMBER[PAUSE]]
    before = np.zeros((len(likely), len(PHONES)), np.int64)
    stays = np.zeros((len(likely), len(PHONES)), np.bool_)
    for place in range(1, len(likely)):
        ended = score[-1][:, None] + steps
        before[place] = ended.argmax(axis=0)
        fresh = np.vstack([ended[before[place], every], score[:-1]])
        stays[place] = score[-1] >= fresh[-1]
        fresh[-1] = np.maximum(fresh[-1], score[-1])
        score = fresh + likely[place]
    return _traced(int(score[-1].argmax()), before, stays)


def _traced(phone: int, before: NDArray[np.int64], stays: NDArray[np.bool_]) -> list[str]:
    """Return the phones of the best path, followed from its end."""
    found, place = [phone], len(before) - 1
    while place > 0:
        if stays[place, phone]:
            place -= 1
            continue
        place -= _SHORTEST_FRAMES - 1
        if place <= 0:
            break
        phone = int(before[place, phone])
        found.append(phone)
        place -= 1
    return [PHONES[number] for number in reversed(found) if PHONES[number] != PAUSE]
