"""Programmes written again: what is copied stays the same, what is changed stays in step."""

import hashlib
import resource
import signal
from collections.abc import Callable, Container
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.media.encode import SoundTarget
from cuecast.media.film import write_film
from cuecast.media.rewrite import Unchanged, rewrite_sound
from receiver.media.programme import SoundFormat, open_programme
from receiver.media.rates import measured_bit_rate
from receiver.media.sound import SoundDecoder, as_float, sound_blocks

FS = 48000
Films = Callable[[str, str, int], Path]


class Late:
    """Gives what it gets, `hold` samples later, as an embedder does."""

    def __init__(self, hold: int) -> None:
        self._hold = hold
        self._kept = np.zeros((0, 2), np.float32)

    def process(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        self._kept = np.concatenate([self._kept, block])
        ready = max(0, len(self._kept) - self._hold)
        out, self._kept = self._kept[:ready], self._kept[ready:]
        return out

    def flush(self) -> NDArray[np.float32]:
        return self._kept


def late(sound: SoundFormat, start_s: float, coding: SoundTarget) -> Late:
    return Late(30000)


def read_sound(path: Path) -> tuple[NDArray[np.float32], float]:
    with open_programme(path) as programme:
        decoder = SoundDecoder(programme, strict=True)
        blocks = list(sound_blocks(decoder, programme))
    assert decoder.start_s is not None
    return np.concatenate(blocks), decoder.start_s


def pictures_of(path: Path) -> list[tuple[str, float]]:
    """Content and time of every decoded picture; times count from the first."""
    with av.open(str(path)) as container:
        frames = [(f.to_ndarray(), f.time) for f in container.decode(video=0)]
    return [(hashlib.md5(x.tobytes()).hexdigest(), round(t - frames[0][1], 3)) for x, t in frames]


def packets_of(path: Path, kind: str) -> list[bytes]:
    with av.open(str(path)) as container:
        stream = next(s for s in container.streams if s.type == kind)
        return [bytes(p) for p in container.demux(stream) if p.size]


CONTAINERS = [
    (".mp4", "aac", 128000), (".mkv", "aac", 128000), (".ts", "aac", 128000),
    (".ts", "mp2", 192000), (".mkv", "libmp3lame", 192000), (".mkv", "libopus", 128000),
    (".mp4", "ac3", 192000), (".mkv", "flac", 0), (".mov", "pcm_s24le", 0),
]  # fmt: skip


@pytest.mark.parametrize(("suffix", "encoder", "bit_rate"), CONTAINERS)
def test_pictures_are_identical_and_parameters_kept(
    make_film: Films, tmp_path: Path, suffix: str, encoder: str, bit_rate: int
) -> None:
    source, target = make_film(suffix, encoder, bit_rate), tmp_path / f"out{suffix}"
    rewrite_sound(source, target, late)
    if suffix != ".ts":  # a transport stream cuts pictures into its packets anew
        assert packets_of(target, "video") == packets_of(source, "video")
    assert pictures_of(target) == pictures_of(source)
    with open_programme(source) as a, open_programme(target) as b:
        assert a.container.format.name == b.container.format.name
        before, after = a.format, b.format
    assert (after.codec, after.fs, after.layout) == (before.codec, before.fs, before.layout)
    assert after.sample_format == before.sample_format
    if bit_rate and before.bit_rate and encoder != "aac":
        assert after.bit_rate == before.bit_rate
    assert [p for p in tmp_path.iterdir() if p != target] == []


@pytest.mark.parametrize(("suffix", "encoder", "bit_rate"), CONTAINERS)
def test_sound_stays_in_step(
    tmp_path: Path, make_film: Films, suffix: str, encoder: str, bit_rate: int
) -> None:
    """The sound moves by less than half a millisecond against the picture."""
    source, target = make_film(suffix, encoder, bit_rate), tmp_path / f"out{suffix}"
    rewrite_sound(source, target, late)
    x, start_x = read_sound(source)
    y, start_y = read_sound(target)
    skip = round((start_x - start_y) * FS)  # an encoder may add its delay, and tell so
    n = min(len(x), len(y)) - 4800
    best = best_shift(x, y, 2400, n, skip)
    # Matroska and MPEG-TS round times to 1 ms and to 11 us. Measured here: 0 to 16 samples.
    assert abs(best) <= 24, f"{best} samples late"
    assert correlation(x, y, 2400, n, skip + best) > 0.98


def best_shift(
    x: NDArray[np.float32], y: NDArray[np.float32], start: int, stop: int, around: int
) -> int:
    return max(range(-48, 49), key=lambda d: correlation(x, y, start, stop, around + d))


def correlation(
    x: NDArray[np.float32], y: NDArray[np.float32], start: int, stop: int, late_by: int
) -> float:
    a = x[start:stop, 0].astype(float)
    b = y[start + late_by : stop + late_by, 0].astype(float)
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))


@pytest.mark.parametrize("subtype", ["PCM_16", "PCM_24", "FLOAT"])
@pytest.mark.parametrize("suffix", [".wav", ".flac"])
def test_lossless_sound_passes_exactly(tmp_path: Path, suffix: str, subtype: str) -> None:
    if suffix == ".flac" and subtype == "FLOAT":
        pytest.skip("FLAC has no floating point")
    source, target = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    x = np.random.default_rng(0).uniform(-0.9, 0.9, (9601, 2)).astype(np.float32)
    soundfile.write(source, x, FS, subtype=subtype)
    result = rewrite_sound(source, target, late)
    assert result.duration_s == pytest.approx(9601 / FS)
    assert soundfile.info(target).subtype == subtype
    np.testing.assert_array_equal(soundfile.read(target)[0], soundfile.read(source)[0])


def test_other_sounds_subtitles_and_labels_are_copied(make_film: Films, tmp_path: Path) -> None:
    source, target = tmp_path / "rich.mkv", tmp_path / "out.mkv"
    add_tracks(make_film(".mkv", "aac", 128000), source)
    rewrite_sound(source, target, late, track=1)
    with av.open(str(source)) as a, av.open(str(target)) as b:
        assert [s.type for s in b.streams] == [s.type for s in a.streams]
        assert [s.metadata.get("language") for s in b.streams] == [None, "fra", "eng", "fra"]
        assert b.metadata["title"] == "Essai"
        assert [s.disposition for s in b.streams] == [s.disposition for s in a.streams]
    for index in (0, 1, 3):
        assert content(target, index) == content(source, index)
    assert content(target, 2) != content(source, 2)


def add_tracks(film: Path, target: Path) -> None:
    """Mux a film with a second sound and a subtitle."""
    lines = target.with_suffix(".srt")
    lines.write_text("1\n00:00:01,000 --> 00:00:02,500\nBonjour\n", encoding="utf-8")
    with av.open(str(film)) as a, av.open(str(lines)) as c, av.open(str(target), "w") as out:
        out.metadata["title"] = "Essai"
        video = out.add_stream_from_template(a.streams.video[0])
        sounds = [out.add_stream_from_template(a.streams.audio[0]) for _ in range(2)]
        text = out.add_stream_from_template(c.streams.subtitles[0])
        for stream, language in zip([*sounds, text], ["fra", "eng", "fra"], strict=True):
            stream.metadata["language"] = language
        out.start_encoding()
        for packet in a.demux():
            if not packet.size:
                continue
            if packet.stream.type == "video":
                packet.stream = video
                out.mux(packet)
                continue
            again = av.Packet(bytes(packet))
            again.pts, again.dts, again.time_base = packet.pts, packet.dts, packet.time_base
            again.duration = packet.duration
            packet.stream, again.stream = sounds
            out.mux([packet, again])
        for line in c.demux():
            if line.size:
                line.stream = text
                out.mux(line)


def content(path: Path, index: int) -> list[tuple[bytes, int | None]]:
    with av.open(str(path)) as container:
        stream = container.streams[index]
        return [(bytes(p), p.pts) for p in container.demux(stream) if p.size]


def test_told_otherwise(make_film: Films, tmp_path: Path) -> None:
    target = tmp_path / "out.mkv"
    rewrite_sound(make_film(".mp4", "aac", 128000), target, late, codec="mp2", bit_rate=256000)
    with open_programme(target) as programme:
        assert programme.format.codec.startswith("mp2")
        assert "matroska" in programme.container.format.name
        assert pictures_of(target) == pictures_of(make_film(".mp4", "aac", 128000))


@pytest.mark.parametrize(
    ("suffix", "codec", "message"),
    [
        (".xyz", None, r"out\.xyz: cannot write: "),
        (".mp4", "nonsense", "sound codec 'nonsense' cannot be written"),
        (".mp4", "libx264", "sound codec 'libx264' cannot be written"),
        (".webm", "aac", "cannot"),
    ],
)
def test_impossible_outputs(
    make_film: Films, tmp_path: Path, suffix: str, codec: str | None, message: str
) -> None:
    with pytest.raises(CueError, match=message):
        rewrite_sound(
            make_film(".mp4", "aac", 128000), tmp_path / f"out{suffix}", late, codec=codec
        )
    assert list(tmp_path.iterdir()) == []


class Broken(Late):
    def process(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        raise KeyboardInterrupt


def test_interrupt_leaves_nothing(make_film: Films, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        rewrite_sound(make_film(".mp4", "aac", 128000), tmp_path / "out.mp4", lambda *_: Broken(0))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not hasattr(signal, "SIGXFSZ"), reason="no limits of files")
def test_a_full_disk_names_the_output(make_film: Films, tmp_path: Path) -> None:
    """The last part is written when the container is closed."""
    film, limits = make_film(".mp4", "aac", 128000), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (film.stat().st_size // 2, limits[1]))
    try:
        with pytest.raises(CueError, match=r"out\.mp4: cannot write: File too large"):
            rewrite_sound(film, tmp_path / "out.mp4", late)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []


def test_does_not_overwrite_its_input(make_film: Films) -> None:
    film = make_film(".mp4", "aac", 128000)
    with pytest.raises(CueError, match="would overwrite"):
        rewrite_sound(film, film, late)


@pytest.mark.parametrize(
    ("suffix", "encoder"),
    [(".mp4", "aac"), (".mkv", "aac"), (".flac", "flac"), (".wav", "pcm_s16le")],
)
@pytest.mark.parametrize("part", [0.5, 0.9])
def test_truncated_programme(tmp_path: Path, suffix: str, encoder: str, part: float) -> None:
    whole, cut = tmp_path / f"whole{suffix}", tmp_path / f"cut{suffix}"
    sound = np.random.default_rng(0).normal(0, 0.1, (20 * FS, 2)).astype(np.float32)
    write_film(whole, sound, FS, encoder=encoder, bit_rate=128000 if encoder == "aac" else 0)
    data = whole.read_bytes()
    cut.write_bytes(data[: int(part * len(data))])
    whole.unlink()
    with pytest.raises(CueError, match=r"truncated|damaged|not a sound"):
        rewrite_sound(cut, tmp_path / f"out{suffix}", late)
    assert list(tmp_path.iterdir()) == [cut]


def test_gap_in_the_sound_is_filled(make_film: Films, tmp_path: Path) -> None:
    """Half a second of lost packets leaves the rest of the sound where it was."""
    source, target = make_film(".mkv", "aac", 128000), tmp_path / "gap.mkv"
    with av.open(str(source)) as a, av.open(str(target), "w") as out:
        copy = out.add_stream_from_template(a.streams.audio[0])
        for packet in a.demux(a.streams.audio[0]):
            if (
                packet.size
                and not 1.0 < float((packet.pts or 0) * (packet.time_base or Fraction(1))) < 1.5
            ):
                packet.stream = copy
                out.mux(packet)
    x, _ = read_sound(source)
    y, _ = read_sound(target)
    assert abs(len(x) - len(y)) < 48
    shift = best_shift(x, y, 2 * FS, 3 * FS, 0)
    assert abs(shift) <= 24
    assert correlation(x, y, 2 * FS, 3 * FS, shift) > 0.9
    assert not y[round(1.1 * FS) : round(1.4 * FS)].any()


def broken(source: Path, target: Path, which: Container[int]) -> None:
    """Copy the sound with the first half of some packets gone."""
    with av.open(str(source)) as a, av.open(str(target), "w") as out:
        copy = out.add_stream_from_template(a.streams.audio[0])
        for number, packet in enumerate(p for p in a.demux(a.streams.audio[0]) if p.size):
            cut: av.Packet[Any] = packet
            if number in which:
                cut = av.Packet(bytes(packet)[packet.size // 2 :])
                cut.pts, cut.dts, cut.time_base = packet.pts, packet.dts, packet.time_base
            cut.stream = copy
            out.mux(cut)


def broadcast(path: Path, start_s: float, seconds: int = 4) -> bytes:
    """A stream whose picture is bright, and whose sounds sound, in the last fifth of each second.

    The picture is sent half a second ahead of the sound, as broadcasters do.
    """
    n = np.arange(seconds * FS)
    tone = np.where(n % FS >= FS * 4 // 5, 0.3 * np.sin(0.3 * n), 0.0).astype(np.float32)
    with av.open(str(path), "w", format="mpegts") as out:
        picture: Any = out.add_stream("mpeg2video", rate=25)
        picture.width = picture.height = 64
        picture.pix_fmt = "yuv420p"
        sounds: list[Any] = [out.add_stream(name, rate=FS) for name in ("aac", "mp2")]
        packets = []
        for sound in sounds:
            sound.layout = "stereo"
        for k in range(25 * seconds):
            level = np.full((64, 64, 3), 200 if k % 25 >= 20 else 40, np.uint8)
            frame = av.VideoFrame.from_ndarray(level, format="rgb24")
            frame.pts, frame.time_base = round(25 * start_s) + k, Fraction(1, 25)
            packets += picture.encode(frame)
            part = np.repeat(tone[None, k * 1920 : (k + 1) * 1920], 2, 0)
            whole = (part.T * 32767).astype(np.int16).reshape(1, -1)
            for sound in sounds:
                plain: Any = part if sound is sounds[0] else whole
                block = av.AudioFrame.from_ndarray(
                    plain, "fltp" if sound is sounds[0] else "s16", "stereo"
                )
                block.sample_rate, block.time_base = FS, Fraction(1, FS)
                block.pts = round(start_s * FS) + k * 1920
                packets += sound.encode(block)
        for stream in (picture, *sounds):
            packets += stream.encode(None)
        ahead = {picture.index: Fraction(1, 2)}
        packets.sort(key=lambda p: p.dts * p.time_base - ahead.get(p.stream.index, 0))
        for packet in packets:
            out.mux(packet)
    return path.read_bytes()


@pytest.mark.parametrize("suffix", [".ts", ".mkv", ".mp4"])
@pytest.mark.parametrize("starts_s", [(0.0, 0.0, 0.0), (100.0, 5.0, 20_000.0)])
def test_a_recording_whose_clock_jumps_goes_on_in_step(
    starts_s: tuple[float, ...], suffix: str, tmp_path: Path
) -> None:
    """Copied pictures kept their stamps: nothing could be written, or sound ran off by hours."""
    source, target = tmp_path / "in.ts", tmp_path / f"out{suffix}"
    source.write_bytes(b"".join(broadcast(tmp_path / "one.ts", at) for at in starts_s))
    rewrite_sound(source, target, late)
    with av.open(str(target)) as container:
        bright = [
            float(f.time or 0) for f in container.decode(video=0) if f.to_ndarray()[0, 0] > 120
        ]
    flashes = [a for a, b in zip(bright, [0.0, *bright], strict=False) if a - b > 0.3]
    assert len(flashes) == 12
    for track in (0, 1):
        with av.open(str(target)) as container:
            loud = [
                float(f.time or 0)
                for f in container.decode(audio=track)
                if np.abs(as_float(f)).max() > 0.05
            ]
        beeps = [a for a, b in zip(loud, [0.0, *loud], strict=False) if a - b > 0.3]
        assert np.abs(np.subtract(flashes, beeps)).max() < 0.06
    times = [t for _, t in pictures_of(target)]
    assert np.diff(times).max() < 0.7


def test_recording_that_begins_within_a_frame(make_film: Films, tmp_path: Path) -> None:
    source, target = make_film(".mkv", "ac3", 192000), tmp_path / "cut.mkv"
    broken(source, target, [0])
    x, _ = read_sound(source)
    y, _ = read_sound(target)
    assert len(x) - len(y) == 1536
    assert correlation(x[1536:], y, FS, 2 * FS, 0) > 0.99


def test_sound_of_which_nothing_can_be_decoded(make_film: Films, tmp_path: Path) -> None:
    broken(make_film(".mkv", "ac3", 192000), tmp_path / "broken.mkv", range(1000))
    with pytest.raises(CueError, match="none of it could be decoded"):
        read_sound(tmp_path / "broken.mkv")


def test_damaged_frames_are_mended_if_one_asks_for_it(make_film: Films, tmp_path: Path) -> None:
    source, damaged = make_film(".mkv", "ac3", 192000), tmp_path / "damaged.mkv"
    broken(source, damaged, [50, 51, 80])
    with pytest.raises(CueError, match=r"damaged sound at 1\.59 s: .*: silence in its .* --mend"):
        rewrite_sound(damaged, tmp_path / "refused.mkv", late)
    assert list(tmp_path.iterdir()) == [damaged]
    written = rewrite_sound(damaged, tmp_path / "mended.wav", late, codec="pcm_s16le", mend=True)
    assert written.left_out == ("3 damaged frames of the sound",)
    x, _ = read_sound(source)
    y, _ = read_sound(tmp_path / "mended.wav")
    assert not y[50 * 1536 : 51 * 1536].any()
    for begin, end in ((1, 49), (53, 79), (83, 120)):
        shift = best_shift(x, y, begin * 1536, end * 1536, 0)
        assert abs(shift) <= 24  # Matroska's times are milliseconds
        assert correlation(x, y, begin * 1536, end * 1536, shift) > 0.99


@pytest.mark.parametrize("suffix", [".ts", ".mkv", ".aac"])
@pytest.mark.parametrize("silent_s", [0, 3])
def test_a_silent_opening_does_not_tell_the_rate(
    tmp_path: Path, suffix: str, silent_s: int
) -> None:
    """Of frames without a header for all of them FFmpeg states the rate of the first one."""
    rng = np.random.default_rng(0)
    loud = rng.normal(0, 0.1, (6 * FS, 2)).astype(np.float32)
    sound = np.concatenate([np.zeros((silent_s * FS, 2), np.float32), loud])
    film, target = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    write_film(film, sound, FS, encoder="aac", bit_rate=96_000)
    rewrite_sound(film, target, lambda *_: Unchanged())
    for path in (film, target):
        assert 88_000 < measured_bit_rate(path) < 108_000


def test_the_rate_of_silence_is_not_known(tmp_path: Path) -> None:
    film = tmp_path / "a.ts"
    write_film(film, np.zeros((4 * FS, 2), np.float32), FS, encoder="aac", bit_rate=96_000)
    assert measured_bit_rate(film) == 0
