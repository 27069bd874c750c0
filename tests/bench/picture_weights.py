"""Do the weights of the picture's receiver serve a film that taught nothing?

In: films, marked as `dub` does and sent through coders and a cleaner; out: for each weight, its
value with the best score of all other films, and what the film that is left out loses by it against
its own best value and against the value that ships. Weights of the demodulator are scored by the
superframes that their information lets expect at the true places, those of the tracker by the
superframes that it reads, and those of its clock by how late positions are. Run:
``python -m tests.bench.picture_weights --store FOLDER FILM ...``.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cuecast.dubbing.picture_coder import picture_channels
from cuecast.evaluate.picture_channels import find_channel, send
from cuecast.media.picture import PictureStage, rewrite_picture
from receiver.media.picture import PictureFormat, picture_format, read_lumas
from watermark.link.superframe import SUPERFRAME_S
from watermark.video import borders, demodulate, lattices, noise, recent_frames, track
from watermark.video.embed import VideoEmbedder
from watermark.video.grid import Grid
from watermark.video.modes import Mode, make_modes
from watermark.video.profile import COLUMNS, ROWS, TEMPLATES, TEXTURE_EVERY, find_profile
from watermark.video.timing import Timing

CHANNELS = (
    "h264-2M", "hevc-1500k", "av1-1M", "mpeg2-4M", "360p-mpeg2-4M", "hqdn3d-h264-2M",
)  # fmt: skip

PROFILE = find_profile("standard")

NEEDED, SLOPE = 1.1, 0.1
"""Information, in parts of a class's bits with its check, at which every second one is decoded, and
the scale of the logistic curve around it."""

SECONDS = 10.0

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Weight:
    """A constant and the values that are tried; the one that ships is tried, too."""

    module: ModuleType
    name: str
    values: tuple[float, ...]

    def tried(self) -> list[float]:
        return sorted({*self.values, float(getattr(self.module, self.name))})


SOFT = (
    Weight(noise, "TEXTURE_OCTAVES", (0.25, 0.35, 0.7, 1.0)),
    Weight(noise, "MOTION_OCTAVES", (0.5, 0.7, 1.4, 2.0)),
    Weight(noise, "STAND_IN", (2.0, 4.0, 16.0, 32.0)),
    Weight(noise, "ALL_KNOWN", (1.0, 16.0)),
    Weight(noise, "MOST", (20.0, 100.0, 1000.0)),
    Weight(demodulate, "LAG_TEXTURE", (0.2, 0.3, 0.7, 1.0)),
    Weight(lattices, "BLUR", (0.05, 0.1, 0.2, 0.3)),
    Weight(lattices, "SEEN_TEXTURE", (0.8, 0.87, 1.0, 1.1)),
)
READ = (
    Weight(track, "THRESHOLD", (0.12, 0.2, 0.24)),
    Weight(track, "OTHER_MODE", (0.03, 0.1, 0.15)),
)
DATED = (
    Weight(borders, "CHANGED", (0.0, 0.015, 0.06, 0.1)),
    Weight(track, "TRUST", (1.0, 2.0, 8.0, 16.0)),
    Weight(borders, "ALIKE", (1.0, 2.0, 8.0, 16.0)),
    Weight(borders, "UNMARKED", (0.1, 0.3, 0.4)),
)


@dataclass(frozen=True, slots=True)
class Film:
    """What arrives of a film through one channel.

    Attributes
    ----------
    values : ndarray of float32, shape (frames, POSITIONS)
    textures : ndarray of float32, shape (frames / TEXTURE_EVERY, ROWS * COLUMNS)
    fps : float
    sent : int
        Superframes that are whole.
    """

    values: NDArray[np.float32]
    textures: NDArray[np.float32]
    fps: float
    sent: int

    # As a tracker's grid, for frames by number.
    seen = np.ones((TEMPLATES, ROWS, COLUMNS), dtype=bool)

    def project(self, number: int) -> Array:
        return np.asarray(self.values[number], dtype=np.float64)

    def texture(self, number: int) -> Array:
        return np.asarray(self.textures[number // TEXTURE_EVERY], dtype=np.float64)


def payload(k: int) -> tuple[bytes, bytes]:
    """Classes of superframe k."""
    rng = np.random.default_rng([0, k])
    return rng.bytes(PROFILE.l0_bytes), rng.bytes(PROFILE.l1_bytes)


def arrived(path: Path, store: Path) -> Iterator[Film]:
    """Mark a film and send it through all channels; its projections are kept in a folder."""
    marked, sent = store / f"{path.stem}.mkv", 0

    def mark(form: PictureFormat) -> list[PictureStage]:
        size = form.width, form.height, form.fps, form.depth
        channels = picture_channels(None, *size)
        return [VideoEmbedder(*size[:3], payload, depth=form.depth, channels=channels)]

    for name in CHANNELS:
        kept = store / f"{path.stem}-{name}.npz"
        if not kept.exists():
            if not marked.exists():
                rewrite_picture(path, marked, mark, codec="ffv1", duration_s=SECONDS)
            coded = send(marked, picture_format(marked), find_channel(name))
            form = picture_format(coded)
            grid = Grid(form.width, form.height, form.depth)
            values, textures = list[Array](), list[Array]()
            for n, (_, luma) in enumerate(read_lumas(coded)):
                values.append(grid.project(luma).reshape(-1).astype(np.float32))
                if n % TEXTURE_EVERY == 0:
                    textures.append(grid.texture(luma).reshape(-1).astype(np.float32))
            np.savez(kept, values=values, textures=textures, fps=float(form.fps))
        data = np.load(kept)
        sent = int(len(data["values"]) / float(data["fps"]) / SUPERFRAME_S)
        yield Film(data["values"], data["textures"], float(data["fps"]), sent)


class Windows:
    """Windows of a film at their true places, in the mode that they were written in."""

    def __init__(self, film: Film) -> None:
        timing = Timing(Fraction(film.fps).limit_denominator(1001))
        modes = make_modes(PROFILE, 0, 1.0)
        self._rows: list[tuple[Array, Array, Array, Array, Mode, int, NDArray[np.int64]]] = []
        for k in range(film.sent):
            start = timing.window_start(k)
            values = film.values[start : start + timing.window].astype(np.float64)
            if len(values) < timing.window:
                break
            before = film.values[max(0, start - recent_frames.LAG_FRAMES) : start or 1]
            rise = values[-recent_frames.LAG_FRAMES :].mean(axis=0) - before.mean(axis=0)
            first = -(-start // TEXTURE_EVERY)
            last = first + timing.window // TEXTURE_EVERY
            texture = film.textures[first:last].mean(axis=0).astype(np.float64)
            mean, variance = values.mean(axis=0), values.var(axis=0)
            coded = modes[0].link.encode(*payload(k))
            mode = max(modes, key=lambda m: information(mean, variance, m, texture, k, coded)[0])
            self._rows.append((mean, variance, rise, texture, mode, k, coded))

    def score(self) -> float:
        """Return the part of all classes that should be read."""
        total = []
        for mean, variance, rise, texture, mode, k, coded in self._rows:
            read = likely(*information(mean, variance, mode, texture, k, coded))
            for lag in demodulate.LAGS if read[0] < 0.5 else ():
                sharp = demodulate.without_lag(mean, rise, np.tile(texture, TEMPLATES), lag)
                sharper = likely(*information(sharp, variance, mode, texture, k, coded))
                read = max(read, sharper, key=lambda each: each[0])
            total.append(read)
        return float(np.mean(total))


def information(
    mean: Array, variance: Array, mode: Mode, texture: Array, k: int, coded: NDArray[np.int64]
) -> tuple[float, float]:
    """Bits that the soft values of each class give about what was sent."""
    first = coded[: PROFILE.l0_coded]
    alone, helped = (
        demodulate.soft_bits(mean, variance, mode, texture, k % 2, first=known).ratios
        for known in (None, first)
    )
    ratios = np.concatenate([alone[: first.size], helped[first.size :]])
    right = np.clip(np.where(coded == 0, ratios, -ratios), -30, 30)
    bits = 1 - np.log2(1 + np.exp(-right))
    return float(bits[: PROFILE.l0_coded].sum()), float(bits[PROFILE.l0_coded :].sum())


def likely(l0_bits: float, l1_bits: float) -> tuple[float, float]:
    """Return how likely each class is decoded; L1 counts only with L0."""
    sizes = 8 * PROFILE.l0_bytes + 24, 8 * PROFILE.l1_bytes + 16
    l0, l1 = (
        1 / (1 + np.exp(min(30.0, (NEEDED - bits / size) / SLOPE)))
        for bits, size in zip((l0_bits, l1_bits), sizes, strict=True)
    )
    return l0, l0 * l1


def tracked(film: Film, part: int) -> float:
    """Return one part of `reception`."""
    return reception(film)[part]


def reception(film: Film) -> tuple[float, float]:
    """Return the part of all classes that a tracker reads, and less how late they are, in ms."""
    timing = Timing(Fraction(film.fps).limit_denominator(1001))
    tracker = track.VideoTracker(film, timing)  # type: ignore[arg-type]
    numbers: list[Any] = list(range(len(film.values)))
    found = [s for number in numbers for s in tracker.process(number)]
    found += tracker.flush()
    read, late_ms = 0, list[float]()
    for superframe in found:
        k = round(superframe.position_s / SUPERFRAME_S)
        l0, l1 = payload(max(0, k))
        if superframe.l0 == l0:
            late_ms.append(1000 * (superframe.position_s - k * SUPERFRAME_S))
            read += 1 + (superframe.l1 == l1)
    return read / (2 * film.sent), -abs(float(np.median(late_ms))) if late_ms else -SUPERFRAME_S


def scores(weight: Weight, films: Sequence[Sequence[Callable[[], float]]]) -> Array:
    """Score of each film, the mean of its channels, with each value, shape (values, films)."""
    shipped = getattr(weight.module, weight.name)
    try:
        rows = []
        for value in weight.tried():
            setattr(weight.module, weight.name, value)
            rows.append([float(np.mean([score() for score in film])) for film in films])
    finally:
        setattr(weight.module, weight.name, shipped)
    return np.array(rows)


def report(weight: Weight, table: Array) -> str:
    """What films lose whose weight the others choose, and which values they cannot tell apart."""
    values = weight.tried()
    shipped = values.index(float(getattr(weight.module, weight.name)))
    chosen = [int(np.delete(table, n, axis=1).mean(axis=1).argmax()) for n in range(table.shape[1])]
    left_out = np.array([table[value, n] for n, value in enumerate(chosen)])
    against_own, against_shipped = table.max(axis=0) - left_out, left_out - table[shipped]
    best = int(table.mean(axis=1).argmax())
    behind = table[best] - table
    error = behind.std(axis=1, ddof=1) / np.sqrt(table.shape[1])
    alike = [v for v, mean, e in zip(values, behind.mean(axis=1), error, strict=True) if mean <= e]
    return (
        f"{weight.name:14} ships {values[shipped]:g}, others choose "
        f"{sorted({values[value] for value in chosen})}: left out, a film loses "
        f"{against_own.mean():.3f} (at most {against_own.max():.3f}) against its own best, gains "
        f"{against_shipped.mean():+.3f} against what ships; not told apart: {alike}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("films", type=Path, nargs="+", metavar="film")
    parser.add_argument("--store", type=Path, required=True, help="folder of what arrives")
    options = parser.parse_args()
    options.store.mkdir(parents=True, exist_ok=True)
    films = [list(arrived(path, options.store)) for path in options.films]
    windows = [[Windows(each).score for each in film] for film in films]
    for weight in SOFT:
        print(report(weight, scores(weight, windows)), flush=True)
    for part, weights in enumerate((READ, DATED)):
        tried = [[partial(tracked, each, part) for each in film] for film in films]
        for weight in weights:
            print(report(weight, scores(weight, tried)), flush=True)


if __name__ == "__main__":
    main()
