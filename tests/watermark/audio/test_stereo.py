"""Two channels: each alone bears the mark, and what they have in common does, too."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.watermark.audio.test_carrier import embed, host, payload, receive
from watermark.audio.embed.stereo_design import LEANING_PERIOD, leaning_of
from watermark.audio.follow.equaliser import Equaliser
from watermark.audio.follow.track import Track
from watermark.audio.follow.track_reader import TrackReader
from watermark.audio.receiver import AudioReceiver
from watermark.audio.signal.channel_choice import LEFT, MID, RIGHT, make_places
from watermark.audio.signal.layout import make_pilots
from watermark.audio.signal.profile import PROFILES, STANDARD
from watermark.audio.signal.sample_buffer import StereoBuffer

Sound = NDArray[np.float32]

WIDE = host(6.0, seed=11)
"""Left and right have nothing in common."""


def payloads(y: Sound) -> list[tuple[bytes | None, bytes | None]]:
    return [(s.l0, s.l1) for s in receive(y, block=4800)]


@pytest.fixture(scope="module")
def marked() -> Sound:
    return embed(WIDE)


@pytest.mark.parametrize("channel", [0, 1], ids=["left", "right"])
def test_a_single_channel_of_wide_stereo_is_read(marked: Sound, channel: int) -> None:
    assert payloads(marked[:, [channel]]) == [payload(k) for k in range(9)]


def test_the_mono_downmix_of_wide_stereo_is_read(marked: Sound) -> None:
    assert payloads(marked.mean(axis=1, keepdims=True)) == [payload(k) for k in range(9)]


def test_a_channel_that_is_silent_does_no_harm() -> None:
    """One channel of a programme may be silence, and stays so."""
    y = embed(WIDE * np.array([1, 0], dtype=np.float32))
    assert not y[:, 1].any()
    assert payloads(y) == [payload(k) for k in range(9)]


def test_channels_that_are_equal_have_the_mark_of_mono() -> None:
    x = WIDE[:, :1]
    both, one = embed(np.repeat(x, 2, axis=1)), embed(x)
    np.testing.assert_array_equal(both, np.repeat(one, 2, axis=1))


def test_more_channels_that_were_mixed_down_are_read() -> None:
    """All their cells stand in the mid."""
    y = embed(host(4.0, channels=6, seed=3))
    left = y[:, 0] + np.sqrt(0.5) * (y[:, 2] + y[:, 4])
    right = y[:, 1] + np.sqrt(0.5) * (y[:, 2] + y[:, 5])
    down = np.stack([left, right], axis=1).astype(np.float32)
    assert payloads(down) == [payload(k) for k in range(6)]


def test_cells_are_read_where_known_bits_fit_better() -> None:
    """Left and right of narrow stereo tell of what stands in the mid, but less."""
    common, own = host(3.0, channels=1, seed=5), host(3.0, seed=6)
    x = (common + 0.1 * own).astype(np.float32)
    middle = x.mean(axis=1, keepdims=True)
    for marked, apart in ((embed(x), True), (x + embed(middle) - middle, False)):
        receiver = AudioReceiver(48000, 2)
        found = receiver.process(marked)
        assert [s.l0 for s in found] == [payload(k)[0] for k in range(len(found))]
        assert len(found) >= 3
        assert receiver._follower.track is not None
        assert receiver._follower.track.pair is apart


@pytest.mark.parametrize("gain", [0.5, 1.5])
def test_a_lock_tells_where_the_cells_stand(gain: float) -> None:
    """A lock by guesses assumes left and right; the past is read as the lock is."""
    common, own = host(8.0, channels=1, seed=5), host(8.0, seed=6)
    x = (common + 0.5 * own).astype(np.float32)
    middle = x.mean(axis=1, keepdims=True)
    heard = (gain * (x + embed(middle) - middle)).astype(np.float32)
    receiver = AudioReceiver(48000, 2)
    found = next(at for at in range(0, len(heard), 4800) if receiver.process(heard[at : at + 4800]))
    assert found is not None
    assert receiver._follower.track is not None
    assert not receiver._follower.track.pair


def test_a_gain_learnt_wrongly_does_no_harm(marked: Sound) -> None:
    """What coders add looks like a change of gain; the nominal steps are tried, too."""
    tape, reader = StereoBuffer(), TrackReader(0, 1.0)
    left, right = marked.T.astype(np.float64)
    tape.append_pair((left + right) / 2, (left - right) / 2)
    demodulator = reader.demodulator(STANDARD.number)
    for offset in (0.0, 0.5):
        track = Track(30720.0, 1.0, demodulator, 6.5, Equaliser(demodulator.bands), offset)
        reading = reader.read(tape, track, reader.view(tape, track), due=True)
        assert reading.decoded.l0 == payload(1)[0]


def test_places_are_the_specification_s() -> None:
    """Section 10, bin by bin."""
    for profile in PROFILES.values():
        places, slots = make_places(profile, 5), make_pilots(5).slots
        period = 8 if profile.name == "high" else 4
        for frame in (0, 17, 63):
            for k in range(profile.first_bin, profile.last_bin):
                block = (k - 30) // 4
                piloted = any(6 + 8 * slot <= k < 14 + 8 * slot for slot in slots[frame])
                wanted = {0: LEFT, period // 2: RIGHT}.get(block % period, MID)
                assert places.bins[frame, k] == (MID if k < 30 or piloted else wanted)
        share = [(places.cells == place).mean() for place in (LEFT, RIGHT)]
        assert min(share) > 0.1
        # No cell stands in two channels.
        first = profile.first_bin + profile.cell_bins * np.arange(profile.groups)
        for i in range(profile.cell_bins):
            row = make_places(profile, 5).bins[:, first + i]
            used = np.array([[k not in _piloted(slots[f]) for k in first + i] for f in range(64)])
            assert (row == places.cells)[used].all()


def _piloted(slots: NDArray[np.int64]) -> set[int]:
    return {6 + 8 * int(slot) + i for slot in slots for i in range(8)}


def test_pilots_lean_now_and_then() -> None:
    leaning = [leaning_of(k) for k in range(2 * LEANING_PERIOD)]
    assert leaning.count(LEFT) == leaning.count(RIGHT) == 2
