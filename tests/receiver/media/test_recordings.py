"""Recordings of broadcasts that change on their way, and files made to cost time."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from codec.cuer.voice import load_voice
from cuecast.command.cli import main
from cuecast.dubbing.receive import receive
from receiver.media.programme import open_programme
from receiver.media.sound import SoundDecoder, read_sound, sound_blocks
from tests.receiver.air import marked_noise, transport_stream
from tests.receiver.live.test_line import at_other_addresses
from tests.receiver.standin import make_motion

VOICE = load_voice()


@pytest.mark.parametrize("service", [True, False])
def test_a_recording_goes_on_at_other_addresses(service: bool, tmp_path: Path) -> None:
    marked = marked_noise(VOICE, make_motion(VOICE, duration_s=16.0), 8)
    first = transport_stream(marked)
    second = at_other_addresses(transport_stream(marked, start_s=8.0), service=service)
    path = tmp_path / "recording.ts"
    path.write_bytes(first)
    alone = receive(path, VOICE, look=False).summary["superframes"]["received"]
    path.write_bytes(first + second)
    both = receive(path, VOICE, look=False).summary
    assert both["superframes"]["received"] >= 2 * alone - 3
    assert both["duration_s"] > 15.0


def test_gaps_that_cost_more_than_they_hold(tmp_path: Path) -> None:
    """A packet of 20 ms every nine seconds: 25 kB that say they last an hour."""
    path = tmp_path / "gaps.mkv"
    with av.open(str(path), "w") as out:
        stream: Any = out.add_stream("libopus", rate=48000)
        stream.layout = "mono"
        tone = np.zeros((1, 960), np.float32)
        for number in range(400):
            frame = av.AudioFrame.from_ndarray(tone, format="fltp", layout="mono")
            frame.sample_rate, frame.time_base = 48000, Fraction(1, 48000)
            frame.pts = number * 960
            for packet in stream.encode(frame):
                packet.pts = packet.dts = packet.pts + 9 * 48000 * number
                out.mux(packet)
    with open_programme(path) as programme:
        decoder = SoundDecoder(programme, strict=False)
        seconds = sum(len(block) for block in sound_blocks(decoder, programme)) / 48000
    assert 8.0 < seconds < 60 + 27 * 8.0


def test_another_sound_is_hinted_at(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "two.mkv"
    marked = marked_noise(VOICE, make_motion(VOICE, duration_s=16.0), 5)
    with av.open(str(path), "w") as out:
        streams: list[Any] = [out.add_stream("pcm_s16le", rate=48000) for _ in range(2)]
        for stream in streams:
            stream.layout = "mono"
        for stream, sound in zip(streams, (0.5 * marked[::-1], marked), strict=True):
            samples = np.rint(sound.T * 32767).astype(np.int16)
            frame = av.AudioFrame.from_ndarray(samples, format="s16", layout="mono")
            frame.sample_rate, frame.pts = 48000, 0
            out.mux(stream.encode(frame))
    assert main(["receive", str(path)]) == 1
    assert "it has 1 more: try --track" in capsys.readouterr().err
    assert main(["receive", str(path), "--track", "1"]) == 0


@pytest.mark.parametrize(("last_s", "follows"), [(6.0, False), (2.0, True)])
def test_a_language_that_begins_later_is_not_followed(
    last_s: float, follows: bool, tmp_path: Path
) -> None:
    path = tmp_path / "languages.ts"
    with av.open(str(path), "w") as out:
        streams: list[Any] = [out.add_stream("mp2", rate=48000) for _ in range(2)]
        for number in range(250):
            for stream, begin_s, end_s in zip(streams, (0.0, 2.0), (last_s, 6.0), strict=True):
                if begin_s <= number * 0.024 < end_s:
                    frame = av.AudioFrame(format="s16", layout="stereo", samples=1152)
                    frame.sample_rate, frame.pts = 48000, number * 1152
                    out.mux(stream.encode(frame))
    with open_programme(path) as programme:
        first = programme.sound.index
        packets = [
            (p.stream.index, p.stream is programme.sound) for p in programme.packets(follow=True)
        ]
        assert (programme.sound.index != first) == follows
        assert len(packets) >= (240 if not follows else 225)
        assert packets[-1][1] or not follows


def test_eight_channels_are_read(tmp_path: Path) -> None:
    """PyAV ends the process where it is asked for the numbers of such a frame."""
    path = tmp_path / "surround.ts"
    wide = av.AudioResampler(format="fltp", layout="7.1", rate=48000)
    words = np.random.default_rng(1).integers(-3000, 3000, (1, 8 * 9600)).astype(np.int16)
    with av.open(str(path), "w") as out:
        stream: Any = out.add_stream("aac", rate=48000)
        stream.layout, stream.bit_rate = "7.1", 512_000
        frame = av.AudioFrame.from_ndarray(words, format="s16", layout="7.1")
        frame.sample_rate, frame.pts = 48000, 0
        for part in wide.resample(frame):
            out.mux(stream.encode(part))
        out.mux(stream.encode(None))
    samples, fs = read_sound(path)
    assert (samples.shape[1], fs) == (8, 48000)
    assert (samples.std(axis=0) > 0.001).all()
