from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from codec.errors import CueError
from tests.watermark.audio.test_carrier import embed, host
from tests.watermark.cells import project
from watermark.audio.follow import _kernels as _follow_kernels
from watermark.audio.follow.smoothing import smooth
from watermark.audio.search import _pilot_kernels, _search_kernels, _soft_kernels
from watermark.audio.search.acquire import LARGEST_PENALTY
from watermark.audio.search.pilot_scan import (
    DECIMATION,
    PARTS,
    ROWS_PER_FRAME,
    SEARCH_HOP,
    SEGMENT_FRAMES,
    STRIDE,
    make_sight,
    rows_of,
    see_stretch,
)
from watermark.audio.search.sliding_search import PilotSearch
from watermark.audio.search.stretch_scores import search_stretch
from watermark.audio.signal import _kernels
from watermark.audio.signal.dither import soft_values
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.mdct import analyse
from watermark.audio.signal.profile import FRAMES_PER_SUPERFRAME, PILOTS_PER_FRAME
from watermark.audio.signal.sample_buffer import SampleBuffer, impulse_responses


def sine(positions: np.ndarray, period: float) -> np.ndarray:
    return np.asarray(np.sin(2 * np.pi * positions / period))


@pytest.mark.parametrize("ratio", [1.0, 1.0001, 44100 / 48000, 48000 / 44100, 4.0])
def test_reads_a_sine_at_any_position_and_speed(ratio: float) -> None:
    tape = SampleBuffer()
    tape.append(sine(np.arange(4000.0), 9.7))
    positions = 1000.3 + ratio * np.arange(400)
    error = tape.read(1000.3, ratio, 400) - sine(positions, 9.7)
    assert np.abs(error).max() < 1e-3  # measured: 8e-5 and less


def test_knows_its_limits() -> None:
    tape = SampleBuffer()
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
    soft = rng.integers(-PARTS, PARTS + 1, (3, 680)).astype(np.int8)
    shift = np.stack([np.ones(8, dtype=np.int64), rng.integers(0, 3, 8)])
    penalty = np.array([PARTS // 2, 0], dtype=np.int16)
    group = rng.integers(0, 3, 64)
    mask = rng.choice([-1, 0], 64).astype(np.int8)
    frames = 10 * np.arange(64) + np.sort(rng.integers(0, 6, 64))
    rows = np.arange(7) + frames[:, np.newaxis] + np.repeat(shift, 8, axis=1)[..., None]
    pilots = (1 + 2 * mask[:, np.newaxis].astype(np.int64)) * soft[group[:, np.newaxis], rows]
    direct = pilots.sum(axis=1) - penalty[:, np.newaxis]
    for add in versions(_search_kernels.pilot_sums):
        sums = np.empty((8, 9), dtype=np.int8)
        add(np.pad(soft, ((0, 0), (5, 0))), 5, frames, group, mask, np.zeros_like(sums), sums)
        for find in versions(_search_kernels.drift_peaks):
            peak = np.empty(7, dtype=np.int16)
            find(sums, shift, penalty, peak)
            np.testing.assert_array_equal(peak, direct.max(axis=0))
        for clock in versions(_search_kernels.clock_of):
            found = [clock(sums, shift, penalty, i) for i in range(7)]
            np.testing.assert_array_equal(found, direct.argmax(axis=0))


def test_largest_sums_fit_their_numbers() -> None:
    """All pilots right, or all wrong and the clock as well; those of a segment."""
    largest = PARTS * PILOTS_PER_FRAME * FRAMES_PER_SUPERFRAME + PARTS * LARGEST_PENALTY
    assert largest < -_search_kernels.LOWEST
    assert np.iinfo(np.int8).max > PARTS * PILOTS_PER_FRAME * SEGMENT_FRAMES
    assert PILOTS_PER_FRAME * SEGMENT_FRAMES >= _search_kernels.FITTING


def test_superframes_before_are_added() -> None:
    rng = np.random.default_rng(3)
    past, peak = (rng.normal(0, PARTS, n).astype(np.int16) for n in (200, 9))
    weights, reach = np.array([0.7, 0.5], dtype=np.float32), np.array([1, 2])
    scores = []
    for i in range(9):
        one = int(peak[i]) + max(past[120 + i + d] for d in (-1, 0, 1))
        two = one + max(past[40 + i + d] for d in (-2, -1, 0, 1, 2))
        scores.append(max(peak[i], 0.7 * one, 0.5 * two))
    for find in versions(_search_kernels.best_sum):
        best, least = pytest.approx(max(scores), rel=1e-5), np.float32(_search_kernels.LOWEST)
        assert find(peak, past, 80, weights, reach, least) == (best, int(np.argmax(scores)))
        assert find(peak, past, 80, weights[:0], reach, least) == (peak.max(), peak.argmax())
        assert find(peak, past, 80, weights, reach, np.float32(999)) == (999, -1)


def test_sight_is_the_receiver_s_mask_and_projection() -> None:
    """What slides on in 32 bits shows what whole transforms show, also where a sound begins."""
    rng, cells = np.random.default_rng(2), make_pilots(0).cells
    sound = rng.normal(size=2400) * np.repeat([1e-2, 0.3, 0.0, 1e-3, 0.1, 0.01], 400)
    sight, masker = make_sight(0), make_masker(cells.last_bin)
    seen, alive, last = sight.look(sound.astype(np.float32), sight.silence)
    frames = np.lib.stride_tricks.sliding_window_view(sound, 2 * SEARCH_HOP)[::STRIDE]
    spectra = np.sqrt(DECIMATION) * analyse(frames, SEARCH_HOP, int(masker.edges[-1]))
    threshold = masker.thresholds(np.abs(spectra) ** 2 / 2)
    before = np.concatenate([np.zeros((ROWS_PER_FRAME, threshold.shape[1])), threshold])
    units = masker.amplitudes(threshold, before[: len(threshold)])
    for own, part in ((seen.real, spectra.real), (seen.imag, spectra.imag)):
        projections, living = project(part, units, cells)
        np.testing.assert_array_equal(alive.T != 0, living)
        np.testing.assert_allclose(own.T, projections, rtol=2e-3, atol=5e-3)
    np.testing.assert_allclose(last.T, before[-ROWS_PER_FRAME:], rtol=2e-3, atol=1e-15)
    assert not living.all()
    assert living.any()


def test_sight_goes_on_from_where_it_ended() -> None:
    sight = make_sight(0)
    sound = np.random.default_rng(5).normal(size=3600).astype(np.float32)
    whole = sight.look(sound, sight.silence)
    first = sight.look(sound[: 1200 + 2 * SEARCH_HOP - STRIDE], sight.silence)
    second = sight.look(sound[1200:], first[2])
    for n in range(2):
        joined = np.concatenate([first[n], second[n]], axis=1)
        np.testing.assert_allclose(joined, whole[n], rtol=1e-3, atol=1e-3)


def test_sight_kernels_agree_with_their_python(monkeypatch: pytest.MonkeyPatch) -> None:
    sight = make_sight(0)
    sound = np.random.default_rng(6).normal(size=2 * SEARCH_HOP + 3 * STRIDE).astype(np.float32)
    compiled = sight.look(sound, sight.silence)
    for name in ("slide", "mask", "project", "look"):
        kernel = getattr(_pilot_kernels, name)
        monkeypatch.setattr(_pilot_kernels, name, getattr(kernel, "py_func", kernel))
    plain = sight.look(sound, sight.silence)
    for one, other in zip(compiled, plain, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-4, atol=1e-5)


def test_what_the_search_has_looked_at_is_remembered() -> None:
    """As if the stretch had been looked at by itself, but for the masks of its first frame."""
    rng, search = np.random.default_rng(8), PilotSearch(0)
    sound, start = rng.normal(0.0, 0.1, 40_000), 0
    assert search.recent(1) is None
    while (count := search.needed) <= sound.size - start:
        search.process(sound[start : start + count])
        start += count
    rows = rows_of(2.2)
    found = search.recent(rows)
    assert found is not None
    begin, (projections, alive) = found
    first = round(begin / DECIMATION)
    assert first + STRIDE * (rows - 1) + 2 * SEARCH_HOP <= start
    cut = sound[first : first + STRIDE * (rows - 1) + 2 * SEARCH_HOP]
    expected, living = see_stretch(0, cut)
    later = slice(SEARCH_HOP // STRIDE, None)
    np.testing.assert_allclose(projections[:, later], expected[:, later], rtol=1e-3, atol=1e-3)
    np.testing.assert_array_equal(alive[:, later], living[:, later])
    assert search.recent(10 * rows) is None


def test_soft_values_of_the_search_are_the_receiver_s() -> None:
    rng, cells = np.random.default_rng(2), make_pilots(0).cells
    seen = (rng.normal(size=(6, 3)) + 1j * rng.normal(size=(6, 3))).astype(np.complex64)
    alive = np.ones((6, 3), dtype=np.float32)
    alive[2, 1] = 0.0
    turn = np.exp(1j * rng.uniform(0, 6, (_soft_kernels.WORD, 6))).astype(np.complex64)
    steps = np.array([3.0, 7.0], dtype=np.float32)
    for kernel in versions(_soft_kernels.pilot_soft):
        soft = np.full((2, 6, 27), 7, dtype=np.int8)
        kernel(seen, alive, turn, cells.dither.astype(np.float32), steps, 2, soft)
        assert (soft[:, :, [0, 1, 26]] == 7).all()
        for t in range(_soft_kernels.WORD):
            projections = (seen * turn[t][:, np.newaxis]).real.T.astype(np.float64)
            for s, step in enumerate(steps):
                expected = soft_values(projections, alive.T > 0, cells, float(step))
                found = soft[s, :, 2 + t : 26 : 8].T / PARTS
                np.testing.assert_allclose(found, expected, atol=1.1 / PARTS)


def test_cells_are_projected_as_the_embedder_does() -> None:
    rng, cells = np.random.default_rng(4), make_pilots(0).cells
    spectra = (rng.normal(size=(5, 480)) + 1j * rng.normal(size=(5, 480))).astype(np.complex64)
    amplitudes = rng.choice([0.0, 0.5, 2.0], (5, 480), p=[0.02, 0.49, 0.49]).astype(np.float32)
    cut = spectra.real[:, : cells.last_bin]
    expected, living = project(cut, amplitudes[:, : cells.last_bin], cells)
    assert 0 < living.mean() < 1
    for kernel in versions(_follow_kernels.project_cells):
        found, alive = np.empty(living.shape), np.empty(living.shape, dtype=np.bool_)
        kernel(spectra, amplitudes, cells.signs, cells.first_bin, found, alive)
        np.testing.assert_array_equal(alive, living)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("around", [False, True])
def test_windows_are_gaussian(around: bool) -> None:
    values = np.random.default_rng(5).normal(size=(64, 38))
    mode = "nearest" if around else "constant"
    expected = gaussian_filter(values, (1.5, 16.0), mode=mode, truncate=4.0)
    np.testing.assert_allclose(smooth(values, (1.5, 16.0), around=around), expected, atol=1e-12)


def test_a_stretch_is_searched_as_the_stream_is() -> None:
    """One superframe alone: what is looked at as a whole shows what the sliding search finds."""
    mid = embed(host(1.4, channels=1))[:, 0].astype(np.float64)
    tape = SampleBuffer()
    tape.append(mid)
    sound = tape.read(0.0, 4.0, mid.size // 4)
    found = search_stretch(0, see_stretch(0, sound), exact=True).best
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
    hop, frames, profiles, places, steps = 3, 12, 3, 4, 1.7
    rows = hop * (frames - 1) + places
    projections = (rng.normal(size=(2, rows)) + 1j * rng.normal(size=(2, rows))).astype(
        np.complex64
    )
    alive = (rng.random((2, rows)) > 0.2).astype(np.float32)
    dither = rng.random(2).astype(np.float32)
    slots = np.stack([rng.permuted([0, 1]) for _ in range(frames)], axis=1)
    signs = rng.choice([-1, 1], (2, profiles, frames)).astype(np.int16)
    signs[0] = signs[0, 0]
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
    for find in versions(_search_kernels.turned_scores):
        score = np.empty((profiles, places), dtype=np.int16)
        find(projections, alive, dither, np.float32(1 / steps), turn, hop, slots, signs, score)
        np.testing.assert_allclose(score / PARTS, expected, atol=2 * frames * 0.5 / PARTS)
