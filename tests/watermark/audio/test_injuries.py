"""What studios and transmitters do to sound without coding it: the mark is still there."""

import itertools
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
import scipy.ndimage
import scipy.signal
from numpy.typing import NDArray

from tests.watermark.audio.test_carrier import embed, host, payload, receive
from watermark.audio.follow.align import SuperframeView, read_view
from watermark.audio.follow.demodulate import Demodulator, SuperframeReading
from watermark.audio.follow.equaliser import PHASES, Equaliser, KnownCells, lean, path_of
from watermark.audio.follow.fit import find_delay
from watermark.audio.follow.track import Track
from watermark.audio.follow.track_reader import FOLLOW, TrackReader
from watermark.audio.receiver import AudioReceiver
from watermark.audio.search.acquire import CLOCK_ERRORS_PPM
from watermark.audio.search.channel_mixes import find_mix, kinds_of
from watermark.audio.search.hypotheses import NEAR_SPEED, make_hypotheses, speeds
from watermark.audio.search.pilot_scan import see_stretch
from watermark.audio.search.sound_ring import Stretch
from watermark.audio.search.stretch_scores import search_stretch
from watermark.audio.signal.layout import Cells
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.profile import STANDARD, SUPERFRAME
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer
from watermark.link.link import Decoded

Sound = NDArray[np.float32]
FS = 48000


def all_pass(x: Sound, frequency_hz: float, q: float = 0.7071) -> Sound:
    """Second order, as in the audio equaliser cookbook of R. Bristow-Johnson."""
    w = 2 * np.pi * frequency_hz / FS
    a, c = np.sin(w) / (2 * q), np.cos(w)
    b = np.array([1 - a, -2 * c, 1 + a])
    return np.asarray(scipy.signal.lfilter(b, b[::-1], x, axis=0), dtype=np.float32)


def rotated(x: Sound) -> Sound:
    return all_pass(all_pass(x, 200.0), 200.0)


def crossed(x: Sound) -> Sound:
    """Three crossovers of fourth order in a row: each is an all-pass as a whole."""
    for frequency_hz in (200.0, 1500.0, 6000.0):
        x = all_pass(x, frequency_hz)
    return x


def late_right(x: Sound) -> Sound:
    spectrum = np.fft.rfft(x[:, 1])
    turn = np.exp(-2j * np.pi * np.arange(spectrum.size) * 0.0002 * FS / len(x))
    return np.stack([x[:, 0], np.fft.irfft(spectrum * turn, len(x))], axis=1).astype(np.float32)


def at_speed(x: Sound, ratio: float) -> Sound:
    count = int(len(x) / ratio)
    out = np.empty((count, x.shape[1]), dtype=np.float32)
    for channel in range(x.shape[1]):
        tape = SampleBuffer()
        tape.append(x[:, channel].astype(np.float64))
        out[:, channel] = tape.read(0.0, ratio, count)
    return out


@lru_cache(maxsize=1)
def marked() -> Sound:
    """A stereo programme whose channels have something in common, as most have."""
    common, own = host(6.0, channels=1, seed=5), host(6.0, seed=6)
    return embed((common + 0.3 * own).astype(np.float32))


@pytest.mark.parametrize(
    "injure",
    [
        rotated,
        crossed,
        lambda x: -x,
        lambda x: x * np.float32(10 ** (-30 / 20)),
        lambda x: x * np.float32(10 ** (13 / 20)),
        lambda x: x * np.float32(10 ** (20 / 20)),
        lambda x: x * np.array([1, -1], dtype=np.float32),
        late_right,
        lambda x: at_speed(x, 25 / 24),
        lambda x: at_speed(x, 24 / 25),
    ],
    ids=["rotator", "crossovers", "inverted", "-30 dB", "+13 dB", "+20 dB", "right inverted",
         "right late", "25/24", "24/25"],
)  # fmt: skip
def test_every_superframe_is_read(injure: Callable[[Sound], Sound]) -> None:
    found = receive(injure(marked()))
    assert [(s.l0, s.l1) for s in found] == [payload(k) for k in range(9)]
    places = [s.position_s for s in found]
    assert places == sorted(places)


def test_bands_beneath_the_floor_are_read() -> None:
    """Where the mask's floor hides the bands of a softened programme, a lower one finds them."""
    tape, reader = SampleBuffer(), TrackReader(0, 1.0)
    tape.append(marked().mean(axis=1).astype(np.float64))
    demodulator = reader.demodulator(STANDARD.number)
    reader._masker = make_masker(floor=1e-2)
    track = Track(30720.0, 1.0, demodulator, 6.0, Equaliser(demodulator.bands))
    raw = reader.view(tape, track)
    levels = demodulator.likely_levels(raw, 6.0)
    assert demodulator.read(raw, levels).decoded.l0 is None
    assert reader.read(tape, track, raw, due=True).decoded.l0 == payload(1)[0]


def test_a_clock_that_leads_astray_is_noticed() -> None:
    """The delay of a superframe is found where it is more than one step of the trial."""
    tape = SampleBuffer()
    tape.append(marked().mean(axis=1).astype(np.float64))
    demodulator = Demodulator(STANDARD, 0)
    view = read_view(tape, 30720.0, 1.0, make_masker())
    reading = demodulator.read(view, demodulator.likely_levels(view, 6))
    expected, cells = demodulator.expected(reading.decoded), demodulator.layout.cells
    for delay in (-1.0, -0.2, 0.6, 1.3):
        late = read_view(tape, 30720.0 - delay, 1.0, make_masker())
        found = find_delay(late, cells, STANDARD.step(reading.level), expected, FOLLOW)
        assert abs(found - delay) < 0.15


def test_blocks_do_not_matter_to_guesses() -> None:
    y = crossed(marked())[: 11 * FS // 2]
    whole, parts = receive(y), receive(y, block=3001)
    assert len(whole) >= 5
    assert [(s.l0, s.position_s) for s in whole] == [(s.l0, s.position_s) for s in parts]


def test_a_receiver_that_does_not_guess_finds_what_is_whole() -> None:
    for x, guess, locked in (
        (marked(), False, True),
        (crossed(marked()), True, True),
        (crossed(marked()), False, False),
    ):
        receiver = AudioReceiver(FS, 2, guess=guess)
        found = [*receiver.process(x[: 11 * FS // 2]), *receiver.flush()]
        assert receiver.locked == bool(found) == locked


def test_a_weight_learnt_wrongly_does_no_harm() -> None:
    """What was learnt may say that every good cell is bad: without it the sound is read."""
    tape = SampleBuffer()
    tape.append(marked().mean(axis=1).astype(np.float64))
    demodulator = Demodulator(STANDARD, 0)
    view = read_view(tape, 30720.0, 1.0, make_masker())
    levels = demodulator.likely_levels(view, 6)
    demodulator.reliability._resultant[:] = np.where(np.arange(STANDARD.groups) < 36, 0.02, 0.95)
    demodulator.reliability._exponents[:] = (1.0, -1.0, 1.0)
    assert demodulator.read(view, levels).decoded.l0 == payload(1)[0]


def test_phases_of_one_superframe_are_used_at_once() -> None:
    """The next one may be weak: what taught them tells whether they serve."""
    tape = SampleBuffer()
    tape.append(marked().mean(axis=1).astype(np.float64))
    demodulator = Demodulator(STANDARD, 0)
    bands, cells = demodulator.bands, demodulator.layout.cells
    plain = read_view(tape, 30720.0, 1.0, make_masker())
    reading = demodulator.read(plain, demodulator.likely_levels(plain, 6))
    known = KnownCells(cells, STANDARD.step(reading.level), demodulator.expected(reading.decoded))
    for bend, used in ((0.0, False), (2.5, True)):
        equaliser = Equaliser(bands)
        bent = Equaliser(bands, np.linspace(0.0, bend, bands))
        equaliser.learn(plain.turned(bent.bins), known)
        assert equaliser.used == used


def test_a_clock_that_changes_within_a_superframe_is_followed() -> None:
    """With the bend the cells are as on a steady clock; the track goes on with the change."""
    sound, bend, start = marked().mean(axis=1).astype(np.float64), 1e-3, 30720.0
    there = np.arange(sound.size, dtype=np.float64)
    place = (there - start) / SUPERFRAME - 0.5
    inside = np.abs(place) < 1
    there[inside] += 0.5 * bend * SUPERFRAME * (place[inside] ** 2 - 0.25)
    at = np.interp(np.arange(sound.size), there, np.arange(sound.size))
    steady, bent = SampleBuffer(), SampleBuffer()
    steady.append(sound)
    bent.append(scipy.ndimage.map_coordinates(sound, [at], order=5))
    demodulator = Demodulator(STANDARD, 0)
    plain = read_view(steady, start, 1.0, make_masker())
    reading = demodulator.read(plain, demodulator.likely_levels(plain, 6))
    expected, cells = demodulator.expected(reading.decoded), demodulator.layout.cells

    def agreement(view: SuperframeView) -> float:
        return float((view.soft(cells, STANDARD.step(reading.level)) * expected).sum())

    followed, not_followed = (
        agreement(read_view(bent, start, 1.0, make_masker(), bend=b)) for b in (bend, 0.0)
    )
    assert followed > 0.9 * agreement(plain) > 1.1 * not_followed
    track = Track(start, 1.0 + bend, demodulator, 6.0, Equaliser(demodulator.bands))
    track.bent(1.0)
    track.advance()
    assert track.ratio == pytest.approx((1 + bend) ** 2)


def covered(x: NDArray[np.float64], duty: float, amplitude: float) -> NDArray[np.float64]:
    """Noise over patches of 0.15 s and two thirds of an octave, as a voice would leave gaps."""
    rng, out = np.random.default_rng(3), x.copy()
    edges = np.geomspace(200.0, 9000.0, 9)
    for band in itertools.pairwise(edges):
        filters = scipy.signal.butter(4, band, "band", fs=FS, output="sos")
        noise = scipy.signal.sosfilt(filters, rng.normal(0.0, amplitude, x.size))
        out += noise * np.repeat(rng.random(-(-x.size // 7200)) < duty, 7200)[: x.size]
    return out


def test_what_covers_a_superframe_shows() -> None:
    """With weights of the past or the same for all cells one of seven is read, not four."""
    sound = embed(host(6.0, channels=1, seed=5))[:, 0].astype(np.float64)
    tape = SampleBuffer()
    tape.append(covered(sound, 0.6, 0.6 * float(sound.std())))
    demodulator, read = Demodulator(STANDARD, 0), 0
    for k in range(1, 8):
        view = read_view(tape, 30720.0 * k, 1.0, make_masker())
        levels = demodulator.likely_levels(view, 6)
        read += demodulator.read(view, levels, due=False).decoded.l0 == payload(k)[0]
    assert read >= 3


class Seen(SuperframeView):
    """A view whose soft values are given."""

    def soft(self, cells: Cells, step: float) -> NDArray[np.float64]:
        return self.amplitudes


def test_decoded_bits_tell_where_their_neighbours_can_be_trusted() -> None:
    """Of a superframe with L0, of which 4 ninths are noise, L1 is read that plain weights lose."""
    demodulator, lost = Demodulator(STANDARD, 0), 0
    l0, l1 = payload(3)
    bits = demodulator.link.encode(l0, l1)
    ideal = demodulator.layout.spread(1.0 - 2.0 * bits)
    first = np.where(np.arange(bits.size) < STANDARD.l0_coded, bits, -1)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        soft = 0.4 * ideal * (np.arange(64) < 36)[:, np.newaxis]
        soft = np.clip(soft + rng.normal(0, 0.6, ideal.shape), -1, 1)
        view = Seen(np.zeros((64, 480), dtype=np.complex128), soft)
        reading = SuperframeReading(
            view,
            5.0,
            np.zeros((3, *ideal.shape)),
            soft,
            demodulator.layout.gather(soft),
            Decoded(l0, None, first),
        )
        plain = demodulator.layout.gather(
            soft * demodulator.reliability.plain(np.zeros((3, *ideal.shape)))
        )
        lost += demodulator.link.second(plain, list_size=64) is None
        again = demodulator.read_second(reading, view)
        assert again.decoded.l1 in (l1, None)
        lost -= again.decoded.l1 is None
    assert lost >= 3  # measured: 5 of 6 more than plain weights read


def test_a_path_of_phases_is_found() -> None:
    bands, rng = 19, np.random.default_rng(0)
    bent = np.round(6 * np.exp(-np.arange(bands) / 4)).astype(int)
    shift = np.round(lean(9.0, bands) * PHASES / (2 * np.pi)).astype(int)
    angle = 2 * np.pi * (np.arange(PHASES) - (bent + shift)[:, np.newaxis]) / PHASES
    table = 25 * np.cos(angle) + rng.normal(0, 5, (bands, PHASES))
    _, delay, phases = path_of(table)
    wrong = np.angle(
        np.exp(1j * (phases + lean(delay, bands) - 2 * np.pi / PHASES * (bent + shift)))
    )
    assert np.abs(wrong).max() < 1.1


def test_the_equaliser_leaves_plain_sound_alone() -> None:
    tape = SampleBuffer()
    tape.append(marked().mean(axis=1).astype(np.float64))
    demodulator = Demodulator(STANDARD, 0)
    equaliser = Equaliser(demodulator.bands)
    for k in range(4):
        view = read_view(tape, k * 30720.0, 1.0, make_masker())
        reading = demodulator.read(view, demodulator.likely_levels(view, 6))
        expected = demodulator.expected(reading.decoded)
        step = STANDARD.step(reading.level)
        equaliser.learn(view, KnownCells(demodulator.layout.cells, step, expected))
        assert not equaliser.used


def test_speeds_leave_no_gap() -> None:
    tried = sorted([1.0, 1 - NEAR_SPEED, 1 + NEAR_SPEED, *speeds()])
    assert tried[0] < 1 / 1.05
    assert tried[-1] > 1 / 0.95
    assert max(b - a for a, b in itertools.pairwise(tried)) < 2.01e-6 * CLOCK_ERRORS_PPM.max()


@pytest.mark.parametrize("speed", [1 - NEAR_SPEED, 1 + NEAR_SPEED])
def test_a_near_speed_shows_in_a_look_at_the_usual_one(speed: float) -> None:
    """Its frames lie at other distances."""
    tape = SampleBuffer()
    tape.append(at_speed(marked(), 1 / speed).mean(axis=1).astype(np.float64))
    seen = see_stretch(0, tape.read(FS, 4.0, int(2.2 * FS / 4)))
    found = search_stretch(0, seen, speed=speed).best
    assert found is not None
    assert found.significance > 7.0  # measured: 9.6 and 8.1; 5.1 at the usual speed
    assert found.clock_ppm == 0.0
    places = (FS + found.start) / speed / SUPERFRAME
    assert abs(places - round(places)) * SUPERFRAME < 4.0


def test_silence_is_guessed_about_in_peace() -> None:
    assert len(make_hypotheses(6)) > 20
    assert all(find_mix(kind, np.zeros((FS, 6))) is None for kind in kinds_of(6))
    assert AudioReceiver(FS, 6).process(np.zeros((4 * FS, 6), dtype=np.float32)) == []


@pytest.mark.parametrize(
    ("channels", "expected"),
    [
        ((1, 1), set()),
        ((1, -1), {(0.5, -0.5)}),
        ((1, 0), {(1.0, 0.0)}),
        ((0, 0), set()),
        ((1, "other"), {(0.5, -0.5), (1.0, 0.0), (0.0, 1.0)}),
    ],
)
def test_mixes_that_tell_nothing_new_are_not_searched(
    channels: tuple[float, float | str], expected: set[tuple[float, ...]]
) -> None:
    rng = np.random.default_rng(0)
    one, other = rng.normal(0, 0.1, (2, 9600))
    sound = np.stack([other if c == "other" else c * one for c in channels], axis=1)
    mixes = (find_mix(kind, sound) for kind in kinds_of(2))
    assert {mix.weights for mix in mixes if mix is not None} == expected


def test_a_stretch_is_heard_at_any_speed() -> None:
    """At the search's rate, in its band, as if the whole sound were read at that speed."""
    rng = np.random.default_rng(1)
    sos = scipy.signal.ellip(10, 0.1, 80, 2700, fs=FS, output="sos")
    sound = scipy.signal.sosfilt(sos, rng.normal(size=FS // 2))
    tape = StereoBuffer(700)
    tape.append_pair(sound, np.zeros_like(sound))
    stretch = Stretch(tape, 1.0)
    for speed in (0.95, 1.0, 1.0031, 1.05):
        found = stretch.low(speed, 0.4)
        direct = stretch.tape.read(700.0, 4 * speed, found.size)
        assert found.size == int(0.4 * 12000 / speed)
        # Its beginning lacks what was before.
        np.testing.assert_allclose(found[20:], direct[20:], atol=2e-3 * sound.std())
