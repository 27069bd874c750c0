import itertools
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.audio.embed.design import pre_echoing
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.embed.levels import HIGHEST_LEVEL, bounded_level
from watermark.audio.follow.stretched_place import MAX_MISSES
from watermark.audio.receiver import AudioReceiver
from watermark.audio.search.sliding_search import PilotSearch
from watermark.audio.signal.profile import LEVELS
from watermark.audio.signal.sample_buffer import SampleBuffer
from watermark.link.superframe import SUPERFRAME_S, ReceivedSuperframe

pytestmark = pytest.mark.long(9)

Sound = NDArray[np.float32]
CLIP = Path(__file__).resolve().parents[4] / "shared" / "data" / "audio" / "film_mix.flac"


def payload(k: int) -> tuple[bytes, bytes]:
    rng = np.random.default_rng(k)
    return rng.bytes(20), rng.bytes(7)


def host(seconds: float, fs: int = 48000, channels: int = 2, seed: int = 0) -> Sound:
    """Pink noise with a slow tremolo: a programme that always carries."""
    n, rng = int(seconds * fs), np.random.default_rng(seed)
    spectrum = np.fft.rfft(rng.standard_normal((n, channels)), axis=0)
    spectrum /= np.sqrt(np.maximum(np.arange(spectrum.shape[0]), 20.0 * seconds))[:, np.newaxis]
    x = np.fft.irfft(spectrum, n, axis=0)
    x *= 0.07 / x.std() * (1 + 0.5 * np.sin(2 * np.pi * 3 * np.arange(n) / fs))[:, np.newaxis]
    return x.astype(np.float32)


def embed(x: Sound, fs: int = 48000, block: int = 10**9, key: int = 0) -> Sound:
    embedder = AudioEmbedder(fs, x.shape[1], payload, key=key)
    parts = [embedder.process(x[i : i + block]) for i in range(0, len(x), block)]
    return np.concatenate([*parts, embedder.flush()])


def receive(
    y: Sound, fs: int = 48000, block: int = 10**9, key: int = 0
) -> list[ReceivedSuperframe]:
    receiver = AudioReceiver(fs, y.shape[1], key=key)
    found = [s for i in range(0, len(y), block) for s in receiver.process(y[i : i + block])]
    return found + receiver.flush()


def check(found: list[ReceivedSuperframe], start_s: float = 0.0) -> None:
    """Every superframe is right and stands within a millisecond of where it was put."""
    for superframe in found:
        k = round((superframe.position_s + start_s) / SUPERFRAME_S)
        assert (superframe.l0, superframe.l1) == payload(k)
        assert abs(superframe.position_s + start_s - k * SUPERFRAME_S) < 1e-3


FORMATS = list(itertools.product((32000, 44100, 48000), (1, 2, 6)))
EACH_ONCE = ((32000, 1), (44100, 6), (48000, 2))
"""Every rate and every number of channels; the slow tests have all pairs."""


@pytest.mark.parametrize(
    ("fs", "channels"),
    [
        *EACH_ONCE,
        *(pytest.param(*f, marks=pytest.mark.slow) for f in FORMATS if f not in EACH_ONCE),
    ],
)
def test_round_trip(fs: int, channels: int) -> None:
    x = host(4.0, fs, channels)
    y = embed(x, fs)
    assert y.shape == x.shape
    found = receive(y, fs)
    assert len(found) == 6
    check(found)


@pytest.mark.parametrize(
    "start", [12345, *(pytest.param(n, marks=pytest.mark.slow) for n in (1, 29999))]
)
def test_tune_in_anywhere(start: int) -> None:
    found = receive(embed(host(4.0))[start:])
    assert len(found) >= 5
    check(found, start / 48000)


@pytest.mark.parametrize("block", [pytest.param(1000, marks=pytest.mark.slow), 4801])
def test_blocks_do_not_matter(block: int) -> None:
    x = host(3.0, seed=1)
    whole = embed(x)
    np.testing.assert_array_equal(whole, embed(x, block=block))
    for a, b in zip(receive(whole), receive(whole, block=block), strict=True):
        assert (a.l0, a.l1, a.position_s) == (b.l0, b.l1, b.position_s)
        np.testing.assert_array_equal(a.ratios, b.ratios)


def test_another_clock_and_a_turned_polarity_are_found() -> None:
    y = embed(host(8.0, channels=1))
    tape = SampleBuffer()
    tape.append(y[:, 0].astype(np.float64))
    fast = tape.read(0.0, 1.001, int(len(y) / 1.001) - 40)[:, np.newaxis].astype(np.float32)
    assert [(s.l0, s.l1) for s in receive(fast)] == [payload(k) for k in range(12)]
    turned = receive(-y)
    assert [(s.l0, s.l1) for s in turned] == [payload(k) for k in range(12)]


def test_a_lock_outlives_what_cannot_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    tape = SampleBuffer()
    tape.append(embed(host(10.5, channels=1))[:, 0].astype(np.float64))
    y = tape.read(0.0, 1 + 40e-6, 10 * 48000)[:, np.newaxis].astype(np.float32)
    y[2 * 48000 : 8 * 48000] = 0.0
    receiver = AudioReceiver(48000, 1)
    found = receiver.process(y[: 2 * 48000])
    monkeypatch.setattr(PilotSearch, "process", lambda search, sound: None)
    later = receiver.process(y[2 * 48000 :])
    assert [s.l0 for s in found] == [payload(k)[0] for k in range(3)]
    # What fails is handed on for a while; the place is known after 6 s without a sample.
    assert [s.l0 for s in later] == [None] * MAX_MISSES + [payload(k)[0] for k in (12, 13, 14)]
    assert later[-1].position_s == pytest.approx(14 * 0.64 / (1 + 40e-6), abs=3e-5)


def test_another_key_hears_nothing() -> None:
    assert receive(embed(host(3.0), key=1), key=2) == []
    check(receive(embed(host(3.0), key=1), key=1))


def test_unmarked_sound_gives_nothing() -> None:
    assert receive(host(5.0)) == []


def test_centre_takes_its_share() -> None:
    x = host(4.0, channels=6)
    x[:96000, :2] = 0.0
    x[96000:, 2] = 0.0
    y = embed(x, block=7000)
    added = (y - x).astype(np.float64)
    early, late = added[9600:86400], added[105600:182400]
    # What a loud centre or a loud pair masks alone goes there alone.
    assert np.abs(early[:, :2]).max() < 1e-6 < early[:, 2].std()
    assert np.abs(late[:, 2]).max() < 1e-6 < late[:, 0].std()
    assert not added[:, 3:].any()
    found = receive(y)
    check(found)
    assert len(found) == 6
    np.testing.assert_array_equal(embed(x), y)


@pytest.mark.parametrize("silent", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_silent_channel_stays_silent(silent: int) -> None:
    x = host(4.0)
    x[:, silent] = 0.0
    y = embed(x, block=7000)
    assert np.abs(y[:, silent]).max() < 1e-6 < (y - x)[:, 1 - silent].std()
    found = receive(y)
    assert len(found) == 6
    check(found)


def test_sparse_sound_carries() -> None:
    """Superframes with a quarter of their sound arrive: single words and pauses."""
    x = host(4.6)
    k, within = np.divmod(np.arange(len(x)), 30720)
    x[(k % 3 == 1) & (within >= 7680)] = 0.0
    embedder = AudioEmbedder(48000, 2, payload)
    found = receive(np.concatenate([embedder.process(x), embedder.flush()]))
    assert embedder.report().silent_s == ()
    assert len(found) == 7
    check(found)


def test_silence_comes_out_unharmed() -> None:
    x = np.zeros((3 * 48000, 2), dtype=np.float32)
    embedder = AudioEmbedder(48000, 2, payload)
    y = np.concatenate([embedder.process(x), embedder.flush()])
    np.testing.assert_array_equal(y, x)
    assert embedder.report().silent_s == ((0.0, 3.2),)


def test_pure_tone_comes_out_unharmed_and_is_reported() -> None:
    t = np.arange(4 * 48000)
    x = np.repeat(0.5 * np.sin(0.05 * t)[:, np.newaxis], 2, axis=1).astype(np.float32)
    embedder = AudioEmbedder(48000, 2, payload)
    y = np.concatenate([embedder.process(x), embedder.flush()])
    report = embedder.report()
    np.testing.assert_array_equal(y, x)
    assert report.silent_s == ((0.0, 4.48),)
    assert (report.superframes, report.snr_db) == (0, None)


def test_unusable_formats() -> None:
    with pytest.raises(CueError, match=r"^sampling rate 8000 Hz"):
        AudioReceiver(8000, 1)
    with pytest.raises(CueError, match=r"^7 channels"):
        AudioEmbedder(48000, 7, payload)
    with pytest.raises(CueError, match=r"^unknown profile 'loud'"):
        AudioEmbedder(48000, 2, payload, profile="loud")


@pytest.mark.skipif(not CLIP.exists(), reason="clips of ../shared/data/audio absent")
def test_film_from_an_arbitrary_sample() -> None:
    import soundfile

    x, fs = soundfile.read(CLIP, dtype="float32", always_2d=True, frames=8 * 48000)
    y = embed(x, fs)
    found = receive(y[54321:], fs)
    assert len(found) >= 10
    check(found, 54321 / fs)


def test_nothing_is_written_before_an_attack() -> None:
    """Stillness before a blow stays still; elsewhere the mark is where it was."""
    x = host(4.0, channels=1)
    x[:100000] *= 0.02
    y = embed(x)
    mark = np.abs((y - x)[:, 0])
    assert mark[99880 - 480 : 99880].max() < 0.1 * mark[100960:102000].max()
    assert not pre_echoing(host(1.0, channels=1)[:, 0].astype(np.float64)).any()
    blow = np.full(480 * 8, 1e-3) * np.resize([1.0, -1.0], 480 * 8)
    blow[480 * 4 + 200 :] *= 30
    assert pre_echoing(blow).tolist() == [False, False, True, True, False, False]


@pytest.mark.parametrize("channels", [1, 2])
def test_above_the_last_step_more_of_the_error_is_removed(channels: int) -> None:
    x, last = host(3.0, channels=channels), len(LEVELS) - 1

    def confidence(level: float) -> float:
        embedder = AudioEmbedder(48000, channels, payload, level=int(level))
        found = receive(np.concatenate([embedder.process(x), embedder.flush()]))
        check(found)
        return float(np.median([superframe.confidence for superframe in found]))

    assert confidence(last) < 0.8
    assert confidence(HIGHEST_LEVEL) > 0.9
    # Only where the whole passage stands so high: not a single superframe that needs much.
    assert bounded_level(last + 1.5, last - 4.0) == last
    assert bounded_level(last + 1.5, last + 1.0) == last + 1.0
    assert bounded_level(last + 9.0, last + 4.0) == HIGHEST_LEVEL
