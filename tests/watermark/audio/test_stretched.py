"""Sound whose duration was changed at its pitch: pieces of it, some milliseconds apart."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.watermark.audio.test_carrier import embed, host, payload
from tests.watermark.cells import project
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.follow.equaliser import Equaliser
from watermark.audio.follow.place_projections import PlaceProjections
from watermark.audio.follow.purse import EARNED, SAVED
from watermark.audio.follow.stretched import StretchedFollower
from watermark.audio.follow.stretched_path import Paths
from watermark.audio.follow.track import Track
from watermark.audio.follow.track_reader import TrackReader
from watermark.audio.receiver import AudioReceiver
from watermark.audio.search.sound_ring import Stretch
from watermark.audio.search.stretched_search import find_stretched
from watermark.audio.signal.layout import make_layout, make_pilots
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.mdct import analyse
from watermark.audio.signal.profile import HOP, STANDARD, SUPERFRAME
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer

FS = 48000
PIECE, SEAM = 9600, 96
"""Samples of a piece, and over which it fades into the next one."""


def in_pieces(x: NDArray[np.float32], dropped: int) -> NDArray[np.float32]:
    """Leave samples out after each piece, or repeat them."""
    fade = np.linspace(0.0, 1.0, SEAM, dtype=np.float32)[:, np.newaxis]
    parts, at = [x[:PIECE]], PIECE + dropped
    while at + PIECE < len(x):
        parts[-1][-SEAM:] = (1 - fade) * parts[-1][-SEAM:] + fade * x[at - SEAM : at]
        parts.append(x[at : at + PIECE].copy())
        at += PIECE + dropped
    return np.concatenate(parts)


@lru_cache(maxsize=1)
def marked() -> NDArray[np.float32]:
    return embed(host(8.5, channels=1, seed=3))


def stretch(sound: NDArray[np.float64]) -> Stretch:
    tape = StereoBuffer()
    tape.append(sound)
    return Stretch(tape, 1.0)


@pytest.mark.parametrize(("dropped", "blocks"), [(400, [4800]), (-384, [4800, 100_000])])
def test_pieces_are_followed(dropped: int, blocks: list[int]) -> None:
    heard, results = in_pieces(marked().copy(), dropped), []
    for block in blocks:
        receiver, found = AudioReceiver(FS, 1), []
        for first in range(0, len(heard), block):
            found += receiver.process(heard[first : first + block])
        found += receiver.flush()
        results.append([(s.l0, s.l1, s.position_s) for s in found])
    assert all(result == results[0] for result in results)
    sent = {payload(k)[0]: payload(k)[1] for k in range(14)}
    read = [l0 for l0, _, _ in results[0] if l0 is not None]
    assert len(set(read)) == len(read) >= 5
    assert all(l0 in sent and l1 in (None, sent[l0]) for l0, l1, _ in results[0] if l0 is not None)


def test_pieces_after_usual_superframes_are_read() -> None:
    whole, read = 2 * SUPERFRAME + PIECE, 0
    sent = {payload(k)[0] for k in range(7)}
    for seed in (3, 4, 5):
        sound = embed(host(8.5, channels=1, seed=seed))
        heard = np.concatenate([sound[:whole], in_pieces(sound[whole:].copy(), 400)])
        receiver, found = AudioReceiver(FS, 1), set()
        for first in range(0, len(heard), 4800):
            found |= {s.l0 for s in receiver.process(heard[first : first + 4800])}
        read += len(sent & found)
    assert read >= 16  # of 21


def test_whole_sound_is_not_followed_in_pieces() -> None:
    """Where a superframe fails by chance, reading it in pieces may succeed by chance."""
    tape, reader = StereoBuffer(), TrackReader(0, 1.0)
    tape.append(marked()[:, 0].astype(np.float64))
    demodulator = reader.demodulator(STANDARD.number)
    track = Track(2.0 * SUPERFRAME, 1.0, demodulator, 3.0, Equaliser(demodulator.bands))
    whole = reader.read(tape, track, reader.view(tape, track), due=True)
    assert whole.decoded.l0 == payload(2)[0]
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(whole.soft.shape)
    # As if read at a wrong level: of a talk in AAC at 64 kbit/s a twentieth was wrong for that.
    fifth = np.where(rng.random(whole.soft.shape) < 1 / 5, -whole.soft, whole.soft)
    for soft, followed in ((whole.soft, False), (fifth, False), (noise, True)):
        usual = replace(whole, soft=soft)
        stretched, due = StretchedFollower(0, FS, 1.0, reader), replace(track, level=whole.level)
        assert [s.l0 for s in stretched.go_on(tape, due, usual)] == [payload(2)[0]] * followed
        assert stretched.locked is followed


def test_no_second_costs_more_than_the_purse_gives() -> None:
    heard = in_pieces(marked().copy(), 400)
    heard += np.random.default_rng(0).normal(0, 0.002, heard.shape).astype(np.float32)
    receiver, spent = AudioReceiver(FS, 1), [0.0]
    for first in range(0, len(heard), FS // 5):
        receiver.process(heard[first : first + FS // 5])
        spent.append(receiver._purse.spent)
    assert spent[-1] > 0.3 * EARNED * len(heard) / FS
    assert np.max(np.subtract(spent[5:], spent[:-5])) < EARNED + SAVED
    assert receiver.untried


def test_sound_without_a_mark_tells_of_no_path() -> None:
    for seed in range(3):
        sound = host(2.2, channels=1, seed=seed)[:, 0].astype(np.float64)
        assert find_stretched(0, stretch(sound).see(0, 1.0, 2.2)) is None


def test_a_path_jumps_where_the_sound_does() -> None:
    heard = in_pieces(marked().copy(), 400)[:, 0].astype(np.float64)
    candidate = find_stretched(0, stretch(heard[:105600]).see(0, 1.0, 2.2))
    assert candidate is not None
    assert candidate.profile == STANDARD.number
    tape = SampleBuffer()
    tape.append(heard)
    demodulator = Demodulator(STANDARD, 0)
    paths = Paths(tape, candidate.places, 1.0, demodulator, make_pilots(0), make_masker())
    levels = [float(level) for level in STANDARD.levels_of(candidate.tier)]
    level, path = paths.find(levels, jump=18.0)
    view, places = paths.view(path, level)
    reading = demodulator.read(view, [level])
    assert reading.decoded.l0 in {payload(k)[0] for k in range(14)}
    # Between its seams the superframe has one jump of 400 samples to each; an end may go astray.
    jumps = np.diff(places) - HOP
    assert 2 <= np.count_nonzero(np.abs(jumps + 400) < 4) <= 4
    assert np.count_nonzero(np.abs(jumps) < 1) >= 58


def test_places_between_transforms_are_as_if_transformed() -> None:
    sound = host(0.5, channels=1, seed=3)[:, 0].astype(np.float32)
    frames = np.lib.stride_tricks.sliding_window_view(sound, 2 * HOP)
    cells, count, apart = make_layout(STANDARD, 0).cells, 40, 16
    places = np.arange(0, count * apart, 2)
    units = np.full((1, HOP), 0.01)
    found = PlaceProjections.of(
        analyse(frames[: count * apart + 1 : apart], HOP),
        units,
        np.zeros(count + 1, np.int64),
        float(apart),
        cells,
    )
    # A table that gives the error back, to a 4096th of a step.
    table = np.tile(np.arange(4096) / 4096, (cells.dither.size, 1))
    seen = found.look_up(20.0, table, np.arange(0.0, apart, 2.0))[0]
    true = project(analyse(frames[places], HOP).real, np.tile(units, (places.size, 1)), cells)[0]
    wrong = seen - (true / 20.0 - cells.dither)
    assert np.abs(wrong - np.round(wrong)).max() < 0.03
