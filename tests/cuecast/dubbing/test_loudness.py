"""As loud as before on every set: what is measured after the standard, and what sets are told."""

import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from cuecast.command.cli import main
from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.media.dolby import settings_of

pytestmark = pytest.mark.long(8)

_WEIGHTS = {"FL": 1.0, "FR": 1.0, "FC": 1.0, "SL": 1.41, "SR": 1.41, "BL": 1.41, "BR": 1.41}


def decoded(path: Path, track: int, **options: str) -> tuple[NDArray[np.float64], list[str]]:
    """Return samples (n, channels) of a file's sound, and the names of its channels."""
    parts = []
    with av.open(str(path)) as container:
        stream = container.streams.audio[track]
        context: Any = av.CodecContext.create(stream.codec_context.name, "r")
        context.options = options
        if stream.codec_context.extradata:
            context.extradata = stream.codec_context.extradata
        for packet in container.demux(stream):
            for frame in context.decode(packet if packet.size else None):
                part = frame.to_ndarray()
                part = part if len(part) > 1 else part.reshape(-1, frame.layout.nb_channels).T
                parts.append(part if part.dtype.kind == "f" else part / 32768.0)
                names = [channel.name for channel in frame.layout.channels]
    return np.concatenate(parts, 1).T, names


def lufs(sound: tuple[NDArray[np.float64], list[str]]) -> float:
    """Integrated loudness after ITU-R BS.1770-4 at 48 kHz, with its two gates."""
    x, names = sound
    shelf = (
        [1.53512485958697, -2.69169618940638, 1.19839281085285],
        [1.0, -1.69065929318241, 0.73248077421585],
    )
    high = [1.0, -2.0, 1.0], [1.0, -1.99004745483398, 0.99007225036621]
    weights = np.array([_WEIGHTS.get(name, 0.0) for name in names])
    power = np.square(lfilter(*high, lfilter(*shelf, x, axis=0), axis=0)) @ weights
    step = FS // 10
    tenths = power[: len(power) // step * step].reshape(-1, step).mean(1)
    blocks = np.convolve(tenths, np.full(4, 0.25), "valid")
    level = -0.691 + 10 * np.log10(blocks + 1e-12)
    kept = level > -70
    kept &= level > -0.691 + 10 * np.log10(blocks[kept].mean()) - 10
    return float(-0.691 + 10 * np.log10(blocks[kept].mean()))


def write(
    path: Path, codec: str, layout: str = "stereo", *, fps: int = 25, fields: bool = False,
    languages: tuple[str, ...] = ("fra",), seconds: int = 8, **options: str,
) -> Path:  # fmt: skip
    """Write a film of FFmpeg's with a sound per language."""
    sound = make_sound()[0][: seconds * FS].astype(np.float32)
    noise = np.random.default_rng(1).integers(40, 200, (9, 16)).astype(np.uint8)
    luma = np.repeat(np.repeat(noise, 32, 0), 32, 1)
    with av.open(str(path), "w") as out:
        shown: Any = out.add_stream("libx264", rate=fps)
        shown.width, shown.height, shown.pix_fmt = 512, 288, "yuv420p"
        shown.bit_rate = 2_000_000
        if fields:
            shown.codec_context.flags |= 1 << 18 | 1 << 29
        heard: list[Any] = []
        for language in languages:
            stream: Any = out.add_stream(codec, rate=FS)
            stream.layout, stream.bit_rate = layout, 384_000 if layout != "stereo" else 192_000
            stream.codec_context.options = dict(options)
            stream.metadata["language"] = language
            heard.append(stream)
        for n in range(seconds * fps):
            picture = av.VideoFrame.from_ndarray(np.roll(luma, 3 * n, 1), format="gray")
            picture = picture.reformat(format="yuv420p")
            picture.pts, picture.time_base = n, Fraction(1, fps)
            out.mux(shown.encode(picture))
        for number, stream in enumerate(heard):
            mux_sound(out, stream, layout, sound * 0.5**number)
        out.mux(shown.encode(None))
    return path


def mux_sound(out: Any, stream: Any, layout: str, plain: NDArray[np.float32]) -> None:
    if layout != "stereo":
        centre = plain.mean(axis=1, keepdims=True)
        plain = np.hstack([plain, centre, 0 * centre, 0.3 * plain])
    form = stream.codec_context.format.name
    resampler = av.AudioResampler(form, layout, FS, frame_size=stream.frame_size or 1152)
    frame = av.AudioFrame.from_ndarray(np.ascontiguousarray(plain.T), "fltp", layout)
    frame.sample_rate, frame.pts, frame.time_base = FS, 0, Fraction(1, FS)
    for part in [*resampler.resample(frame), *resampler.resample(None)]:
        out.mux(stream.encode(part))
    out.mux(stream.encode(None))


def first_frame(path: Path) -> bytes:
    with av.open(str(path)) as container:
        return bytes(next(p for p in container.demux(container.streams.audio[0]) if p.size))


@pytest.mark.parametrize(
    ("codec", "live"),
    [
        ("ac3", False),
        ("eac3", True),
        pytest.param("eac3", False, marks=pytest.mark.slow),
        pytest.param("ac3", True, marks=pytest.mark.slow),
    ],
)
def test_sets_are_told_the_same_loudness(tmp_path: Path, codec: str, *, live: bool) -> None:
    """A decoder that brings all programmes to one level makes the same of both."""
    source = write(tmp_path / "a.ts", codec, "5.1(side)", seconds=5, dialnorm="-24")
    (tmp_path / "a.srt").write_text(as_srt(make_sound()[1][:3]), encoding="utf-8")
    given = ["--subtitles", str(tmp_path / "a.srt")]
    target = tmp_path / "b.ts"
    if live:
        assert main(["playout", str(source), str(target), *given]) == 0
    else:
        fast = ["--no-grade", "--no-read-back"]
        assert main(["dub", str(source), "-o", str(target), *given, *fast]) == 0
    assert settings_of(first_frame(source))["dialnorm"] == "-24"
    plain = [lufs(decoded(path, 0)) for path in (source, target)]
    levelled = [lufs(decoded(path, 0, target_level="-31")) for path in (source, target)]
    assert plain[0] - levelled[0] == pytest.approx(7.0, abs=0.05)
    assert plain[1] == pytest.approx(plain[0], abs=0.1)
    assert levelled[1] == pytest.approx(levelled[0], abs=0.1)


def test_frames_that_tell_nothing() -> None:
    assert settings_of(b"") == settings_of(bytes(200)) == {}
    assert settings_of(b"\xff\xf1" + bytes(20)) == {}


BOTH = ["--carriers", "audio,video", "--video-bitrate", "2000k"]
"""The blocks roll so evenly that coders spend 30 to 60 kbit/s on them: too few for a mark."""

FORMS: dict[str, tuple[Callable[[Path], Path], list[str]]] = {
    "50 frames": (lambda p: write(p / "a.ts", "mp2", fps=50), BOTH),
    "fields": (lambda p: write(p / "a.ts", "mp2", fields=True), BOTH),
    "surround": (lambda p: write(p / "a.ts", "ac3", "5.1(side)"), []),
    "languages": (
        lambda p: write(p / "a.ts", "mp2", languages=("deu", "fra", "eng")),
        ["--track", "1"],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMS)
def test_forms_of_broadcasts(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Read back, as loud as before, everything else as it was."""
    make, options = FORMS[name]
    source, target = make(tmp_path), tmp_path / "b.ts"
    (tmp_path / "a.srt").write_text(as_srt(make_sound()[1][:3]), encoding="utf-8")
    capsys.readouterr()
    dub = ["dub", str(source), "--subtitles", str(tmp_path / "a.srt"), "-o", str(target)]
    assert main([*dub, "--no-grade", "--json", *options]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told["read_back"]["carriers"]) == (
        ["audio", "video"] if options == BOTH else ["audio"]
    )
    for carrier, found in told["read_back"]["carriers"].items():
        assert found["received"] >= 0.9 * found["sent"], carrier
    track = 1 if name == "languages" else 0
    assert lufs(decoded(target, track)) == pytest.approx(lufs(decoded(source, track)), abs=0.1)
    with av.open(str(source)) as one, av.open(str(target)) as other:
        assert [s.language for s in one.streams.audio] == [s.language for s in other.streams.audio]
        assert one.streams.video[0].average_rate == other.streams.video[0].average_rate
        if name == "fields":
            assert all(frame.interlaced_frame for frame in other.decode(video=0))
    if name == "languages":
        for other_track in (0, 2):
            before, after = (decoded(path, other_track)[0] for path in (source, target))
            np.testing.assert_array_equal(before, after)
