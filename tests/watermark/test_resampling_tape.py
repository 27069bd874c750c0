from typing import Any

import numpy as np
import pytest

from codec.errors import CueError
from tests.watermark.test_carrier import embed, host
from watermark.audio import _kernels
from watermark.audio.acquire import PilotSearch, search_stretch
from watermark.audio.dither import project, soft_values
from watermark.audio.layout import make_pilots
from watermark.audio.resampling_tape import Tape, impulse_responses


def sine(positions: np.ndarray, period: float) -> np.ndarray:
    return np.asarray(np.sin(2 * np.pi * positions / period))


@pytest.mark.parametrize("ratio", [1.0, 1.0001, 44100 / 48000, 48000 / 44100, 4.0])
def test_reads_a_sine_at_any_position_and_speed(ratio: float) -> None:
    tape = Tape()
    tape.append(sine(np.arange(4000.0), 9.7))
    positions = 1000.3 + ratio * np.arange(400)
    error = tape.read(1000.3, ratio, 400) - sine(positions, 9.7)
    assert np.abs(error).max() < 1e-3  # measured: 8e-5 and less


def test_knows_its_limits() -> None:
    tape = Tape()
    tape.append(np.ones(100))
    tape.forget(40)
    assert (tape.first, tape.end) == (40, 100)
    assert tape.read(38.0, 1.0, 4).tolist() == [0.0, 0.0, 1.0, 1.0]
    with pytest.raises(CueError, match=r"^resampling ratio 0 is not within 0..64$"):
        tape.read(0.0, 0, 1)


def test_kernels_agree_with_their_python() -> None:
    rng = np.random.default_rng(0)
    x, table = rng.standard_normal(300), impulse_responses(0.5)
    for kernel in (_kernels.interpolate, getattr(_kernels.interpolate, "py_func", None)):
        out = np.empty(5)
        assert kernel is not None
        kernel(x, 90.2, 1.7, table, out)
        if kernel is _kernels.interpolate:
            expected = out
    np.testing.assert_allclose(out, expected, rtol=0, atol=1e-12)


def versions(kernel: Any) -> list[Any]:
    """Return a kernel as compiled and as Python."""
    return list(dict.fromkeys([kernel, getattr(kernel, "py_func", kernel)]))


def test_pilot_kernels() -> None:
    rng = np.random.default_rng(1)
    soft = rng.standard_normal((3, 180)).astype(np.float32)
    shift = np.stack([np.ones(8, dtype=np.int64), rng.integers(0, 3, 8)])
    penalty = np.array([0.5, 0.0], dtype=np.float32)
    group = rng.integers(0, 3, 16)
    sign = rng.choice([-1.0, 1.0], 16).astype(np.float32)
    rows = np.arange(7) + 10 * np.arange(16)[:, np.newaxis] + np.repeat(shift, 2, axis=1)[..., None]
    pilots = sign[:, np.newaxis] * soft[group[:, np.newaxis], rows]
    direct = pilots.sum(axis=1) - penalty[:, np.newaxis]
    for add in versions(_kernels.pilot_sums):
        sums = np.zeros((8, 9), dtype=np.float32)
        add(np.pad(soft, ((0, 0), (5, 0))), 5, 10, 2, group, sign, sums)
        for find in versions(_kernels.drift_peaks):
            peak, drift = np.empty(7, dtype=np.float32), np.empty(7, dtype=np.int32)
            find(sums, shift, penalty, peak, drift)
            np.testing.assert_array_equal(drift, direct.argmax(axis=0))
            np.testing.assert_allclose(peak, direct.max(axis=0), rtol=1e-5)


def test_superframes_before_are_added() -> None:
    rng = np.random.default_rng(3)
    past, peak = rng.normal(size=30).astype(np.float32), rng.normal(size=5).astype(np.float32)
    lag, weights = rng.integers(9, 13, 3), np.array([0.7, 0.5], dtype=np.float32)
    error = rng.integers(0, 3, 5).astype(np.int32)
    for add in versions(_kernels.add_priors):
        for floor in (-9.0, 0.8):
            score = np.empty(5, dtype=np.float32)
            add(peak, error, lag, past, weights, past.max(), np.float32(floor), score)
            for i in range(5):
                back = 30 + i - lag[error[i]]
                one = peak[i] + max(past[back + d] for d in (-1, 0, 1))
                back -= lag[error[i]]
                two = one + max(past[back + d] for d in (-2, -1, 0, 1, 2))
                expected = max(peak[i], 0.7 * one, 0.5 * two)
                assert score[i] == pytest.approx(expected, rel=1e-5) or (
                    score[i] == peak[i] and expected <= floor
                )


def test_soft_values_of_the_search_are_the_receiver_s() -> None:
    rng, cells = np.random.default_rng(2), make_pilots(0).cells
    spectra = (rng.normal(size=(3, 60)) + 1j * rng.normal(size=(3, 60))).astype(np.complex64)
    amplitudes = rng.uniform(0.05, 0.2, (3, 60)).astype(np.float32)
    amplitudes[1, 20] = 0.0
    angle = rng.uniform(0, 6, (2, 6))
    turn, steps = np.exp(1j * angle).astype(np.complex64), np.array([3.0, 7.0], dtype=np.float32)
    signs, dither = cells.signs.astype(np.float32), cells.dither.astype(np.float32)
    for look, kernel in zip(
        versions(_kernels.pilot_projections), versions(_kernels.pilot_soft), strict=True
    ):
        seen, alive = np.empty((6, 3), np.complex64), np.empty((6, 3), np.float32)
        look(spectra, amplitudes, cells.first_bin, signs, seen, alive)
        soft = np.full((2, 6, 9), 7.0, dtype=np.float32)
        kernel(seen, alive, turn, dither, steps, 2, soft)
        assert (soft[:, :, [0, 1, 8]] == 7.0).all()
        for t in range(2):
            bins = np.zeros(60)
            bins[cells.first_bin : cells.last_bin] = np.repeat(angle[t], cells.bins)
            turned = (spectra * np.exp(1j * bins)).real.astype(np.float64)
            projections, living = project(turned, amplitudes.astype(np.float64), cells)
            for s, step in enumerate(steps):
                expected = soft_values(projections, living, cells, float(step))
                np.testing.assert_allclose(soft[s, :, 2 + t : 8 : 2].T, expected, atol=5e-4)


def test_a_stretch_is_searched_as_the_stream_is() -> None:
    """One superframe alone: what is looked at as a whole shows what the sliding search finds."""
    mid = embed(host(1.4, channels=1))[:, 0].astype(np.float64)
    tape = Tape()
    tape.append(mid)
    sound = tape.read(0.0, 4.0, mid.size // 4)
    found = search_stretch(0, sound)
    search, streamed, start = PilotSearch(0), [], 0
    while (count := search.needed) <= sound.size - start:
        candidate = search.process(sound[start : start + count])
        start += count
        streamed += [candidate] if candidate else []
    assert found is not None
    assert any(
        (c.start, c.profile, c.tier) == (found.start, found.profile, found.tier) for c in streamed
    )


def test_turned_scores_count_the_best_phase_of_each_slot() -> None:
    rng = np.random.default_rng(4)
    hop, frames, profiles, places, steps = 3, 5, 2, 4, 1.7
    rows = hop * (frames - 1) + places
    projections = (rng.normal(size=(2, rows)) + 1j * rng.normal(size=(2, rows))).astype(
        np.complex64
    )
    alive = (rng.random((2, rows)) > 0.2).astype(np.float32)
    dither = rng.random(2).astype(np.float32)
    slots = np.stack([rng.permuted([0, 1]) for _ in range(frames)], axis=1)
    signs = rng.choice([-1.0, 1.0], (2, profiles, frames)).astype(np.float32)
    turn = np.exp(2j * np.pi * np.arange(6) / 6).astype(np.complex64)
    soft = alive * np.cos(
        2 * np.pi * ((projections * turn[:, None, None]).real / steps - dither[:, None])
    )
    expected = np.zeros((profiles, places))
    for p in range(profiles):
        for s in range(2):
            total = np.zeros((6, places))
            for f in range(frames):
                for n, sign in ((0, signs[0, 0, f]), (1, signs[1, p, f])):
                    if slots[n, f] == s:
                        total += sign * soft[:, s, hop * f : hop * f + places]
            expected[p] += total.max(axis=0)
    for find in versions(_kernels.turned_scores):
        score = np.empty((profiles, places), dtype=np.float32)
        find(projections, alive, dither, np.float32(1 / steps), turn, hop, slots, signs, score)
        np.testing.assert_allclose(score, expected, atol=5e-3)
