"""Subtitles inside programmes: the same text gives the same subtitles, however it is carried."""

import gzip
import json
import struct
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from av.stream import Disposition

from codec.errors import CueError
from cuecast.command.cli import main
from cuecast.demo.content import FS, make_sound
from cuecast.media.captions import captions_of
from cuecast.media.subtitles import choose_track, read_track, text_tracks
from cuecast.media.tables import TableReader, checksum, read_map
from synth.language.subtitles import read_subtitles
from synth.language.subtitles.read import parse_subtitles

LINES = [(0.52, 2.04, "Bonjour à tous,"), (2.2, 3.96, "nous partons & revenons.")]
SRT = "".join(
    f"{n}\n00:00:{a:06.3f} --> 00:00:{b:06.3f}\n{text}\n\n".replace(".", ",", 2)
    for n, (a, b, text) in enumerate(LINES, 1)
)
_HEADER = (
    b"[Script Info]\r\nScriptType: v4.00+\r\nPlayResX: 384\r\nPlayResY: 288\r\n\r\n"
    b"[V4+ Styles]\r\nFormat: Name, Fontname, Fontsize, "
    b"PrimaryColour, SecondaryColour, OutlineColour, BackColour, Bold, Italic, Underline, "
    b"StrikeOut, ScaleX, ScaleY, Spacing, Angle, BorderStyle, Outline, Shadow, Alignment, MarginL, "
    b"MarginR, MarginV, Encoding\r\nStyle: Default,Arial,16,&Hffffff,&Hffffff,&H0,&H0,0,0,0,0,100,"
    b"100,0,0,1,1,0,2,10,10,10,0\r\n\r\n[Events]\r\nFormat: Layer, Start, End, Style, Name, "
    b"MarginL, MarginR, MarginV, Effect, Text\r\n"
)


def timed(text: str) -> bytes:
    return struct.pack(">H", len(text.encode())) + text.encode()


def event(text: str) -> bytes:
    return f"0,0,Default,,0,0,0,,{{\\i1}}{text}{{\\i0}}".encode()


def span(text: str) -> bytes:
    return f"<span>{text.replace('&', '&amp;')}</span>".encode()


def document(lines: list[tuple[float, float, str]]) -> bytes:
    paragraphs = "".join(
        f'<p begin="{a:.3f}s" end="{b:.3f}s">{t.replace("&", "&amp;")}</p>' for a, b, t in lines
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?><tt xmlns="http://www.w3.org/ns/ttml" '
        f'xml:lang="fr"><body><div>{paragraphs}</div></body></tt>'
    ).encode()


def segment(document: bytes, mediatime_s: float, *, packed: bool) -> bytes:
    body = gzip.compress(document) if packed else document
    data = round(mediatime_s * 10_000).to_bytes(6, "big") + b"\x01"
    data += bytes([2 if packed else 1]) + struct.pack(">H", len(body)) + body
    return data + struct.pack(">I", checksum(data))


Packets = list[tuple[float, float, bytes]]


def make(
    path: Path,
    tracks: list[tuple[str, str, Packets]],
    shift_s: float = 0.0,
    roles: Sequence[Disposition] = (),
    late_s: float = 0.0,
) -> Path:
    """Write six seconds of picture and sound with tracks (coding, language, packets).

    The picture begins `late_s` after the sound.
    """
    sound = make_sound()[0][: 6 * FS].T
    options = {"output_ts_offset": str(shift_s)}
    with av.open(str(path), "w", options=options) as out:
        picture: Any = out.add_stream("mpeg2video" if path.suffix == ".ts" else "libx264", rate=25)
        picture.width = picture.height = 64
        picture.pix_fmt = "yuv420p"
        heard: Any = out.add_stream("aac", rate=48000)
        texts: list[Any] = []
        for coding, language, _ in tracks:
            stream: Any = out.add_stream(coding)
            stream.codec_context.subtitle_header = _HEADER
            stream.metadata["language"] = language
            texts.append(stream)
        for stream, role in zip(texts, roles, strict=False):
            stream.disposition = role
        for n in range(150):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), n, np.uint8), format="rgb24")
            frame.pts, frame.time_base = n + round(25 * late_s), Fraction(1, 25)
            out.mux(picture.encode(frame))
        for start in range(0, sound.shape[1], 1024):
            block = sound[:, start : start + 1024]
            part = av.AudioFrame.from_ndarray(np.ascontiguousarray(block), "fltp", "stereo")
            part.sample_rate, part.pts, part.time_base = 48000, start, Fraction(1, 48000)
            out.mux(heard.encode(part))
        for stream, (_, _, packets) in zip(texts, tracks, strict=True):
            for start_s, length_s, data in packets:
                packet = av.Packet(data)
                packet.stream, packet.time_base = stream, Fraction(1, 1000)
                packet.pts = packet.dts = round(start_s * 1000)
                packet.duration = round(length_s * 1000)
                out.mux(packet)
        out.mux(picture.encode(None))
        out.mux(heard.encode(None))
    return path


def each(form: Callable[[str], bytes]) -> Packets:
    return [(a, b - a, form(text)) for a, b, text in LINES]


CARRIED: dict[str, tuple[str, str, Packets]] = {
    "mov_text": (".mp4", "mov_text", each(timed)),
    "subrip": (".mkv", "subrip", each(str.encode)),
    "ass": (".mkv", "ass", each(event)),
    "webvtt": (".mkv", "webvtt", each(lambda text: text.replace("&", "&amp;").encode())),
    "ts document": (".ts", "ttml", [(0.0, 6.0, document(LINES))]),
    "ts segments": (
        ".ts",
        "ttml",
        [
            (a - 0.2, b - a, segment(document([(a + 70, b + 70, t)]), a - 0.2 + 70, packed=n == 1))
            for n, (a, b, t) in enumerate(LINES)
        ],
    ),
}


@pytest.mark.parametrize("name", CARRIED)
@pytest.mark.parametrize("shift_s", [0.0, 1.4])
def test_same_text_same_subtitles(tmp_path: Path, name: str, shift_s: float) -> None:
    suffix, coding, packets = CARRIED[name]
    film = make(tmp_path / f"a{suffix}", [(coding, "fra", packets)], shift_s)
    track = choose_track(text_tracks(film), None, "a")
    found = [(s.start_s, s.end_s, s.text) for s in read_track(film, track)]
    assert found == [(s.start_s, s.end_s, s.text) for s in parse_subtitles(SRT.encode())]


def test_text_goes_on_where_the_clock_jumps(tmp_path: Path) -> None:
    """Two recordings joined: the second one's text stood over the first one's sound."""
    suffix, coding, packets = CARRIED["ts segments"]
    film = make(tmp_path / f"a{suffix}", [(coding, "fra", packets)], 30.0)
    film.write_bytes(
        film.read_bytes() + make(tmp_path / "b.ts", [(coding, "fra", packets)]).read_bytes()
    )
    track = choose_track(text_tracks(film), None, "a")
    found = [(s.start_s, s.end_s, s.text) for s in read_track(film, track)]
    assert [text for _, _, text in found] == 2 * [text for _, _, text in LINES]
    starts = np.array([start_s for start_s, _, _ in found]).reshape(2, -1)
    assert np.abs(starts[1] - starts[0] - 6.0).max() < 0.1


def test_document_in_mp4(tmp_path: Path) -> None:
    """FFmpeg's own writer of TTML makes the document here."""
    film = make(tmp_path / "a.mp4", [("ttml", "fra", each(span))])
    track = choose_track(text_tracks(film), None, "a")
    assert track.coding == "TTML"
    found = [(s.start_s, s.end_s, s.text) for s in read_track(film, track)]
    assert found == LINES


@pytest.mark.parametrize(
    ("name", "late_s"),
    [
        ("mov_text", 0.0),
        ("mov_text", 1.2),
        pytest.param("subrip", 0.0, marks=pytest.mark.slow),
        pytest.param("ts segments", 0.0, marks=pytest.mark.slow),
    ],
)
def test_keys_are_those_of_the_file(tmp_path: Path, name: str, late_s: float) -> None:
    suffix, coding, packets = CARRIED[name]
    film = make(tmp_path / f"a{suffix}", [(coding, "fra", packets)], late_s=late_s)
    (tmp_path / "a.srt").write_text(SRT, encoding="utf-8")
    keys = []
    for target, given in (("one", []), ("two", ["--subtitles", str(tmp_path / "a.srt")])):
        report, out = tmp_path / f"{target}.json", tmp_path / f"{target}{suffix}"
        dub = ["dub", str(film), *given, "--no-grade", "--no-read-back", "-o", str(out)]
        status = main([*dub, "--report", str(report)])
        assert status == 0
        keys.append(json.loads(report.read_text(encoding="utf-8"))["keys"])
    times = np.array([[[key.pop("start"), key.pop("end")] for key in each] for each in keys])
    assert keys[0] == keys[1]
    # A file counts from the container's start: in a transport stream AAC's first frame is 21 ms
    # before 0, and the cuer's pace makes more of it.
    assert np.abs(times[0] - times[1]).max() <= (0.1 if suffix == ".ts" else 1e-6)
    assert len(keys[0]) > 8


def test_choice_of_track(tmp_path: Path) -> None:
    one = [(1.0, 1.0, b"Non")]
    film = make(
        tmp_path / "a.mkv",
        [
            ("subrip", "eng", one),
            ("dvbsub", "fra", [(1.0, 1.0, b"\x20\x00\x0f")]),
            ("subrip", "fre", each(str.encode)),
            ("webvtt", "fra", one),
        ],
    )
    tracks = text_tracks(film)
    assert [t.coding for t in tracks] == ["SubRip", "DVB bitmaps", "SubRip", "WebVTT"]
    assert choose_track(tracks, None, "a").number == 2
    assert choose_track(tracks, "eng", "a").number == 0
    assert choose_track(tracks, "fr", "a").number == 2
    assert choose_track(tracks, "3", "a").number == 3
    for wanted, message in [
        ("1", "DVB bitmaps.*cannot be read as text"),
        ("9", "no subtitle track '9', it has 0: SubRip, eng; 1: DVB bitmaps"),
        ("deu", "no subtitle track 'deu'"),
    ]:
        with pytest.raises(CueError, match=message):
            choose_track(tracks, wanted, "a")
    captions = captions_of(film)
    assert captions is not None
    assert captions.language == "fr"
    assert captions.data.decode() == (
        "WEBVTT\n\n00:00:00.520 --> 00:00:02.040\nBonjour à tous,\n\n"
        "00:00:02.200 --> 00:00:03.960\nnous partons &amp; revenons.\n"
    )
    assert captions_of(make(tmp_path / "none.mkv", [])) is None
    with pytest.raises(CueError, match=r"no text among its subtitles .1: DVB bitmaps"):
        choose_track(tracks[1:2], None, "a")
    with pytest.raises(CueError, match=r"no French subtitles .0: SubRip, eng.: choose with"):
        choose_track(tracks[:1], None, "a")
    with pytest.raises(CueError, match=r"timed text of MXF cannot\): give them"):
        choose_track([], None, "a.MXF")
    with pytest.raises(CueError, match="a: no subtitles in it: give"):
        choose_track([], None, "a")


def test_a_forced_track_is_the_last_choice(tmp_path: Path) -> None:
    """It has the few lines in another language alone; a default one goes first."""
    tracks = [("subrip", "fre", each(str.encode)) for _ in range(3)]
    roles = [Disposition.forced, Disposition(0), Disposition.default]
    found = text_tracks(make(tmp_path / "a.mkv", tracks, roles=roles))
    assert [(t.forced, t.default) for t in found] == [(True, False), (False, False), (False, True)]
    assert choose_track(found, None, "a").number == 2
    assert choose_track(found[:2], None, "a").number == 1
    assert choose_track(found, "0", "a").number == 0


def test_programme_without_subtitles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = make(tmp_path / "a.mp4", [])
    assert main(["dub", str(film), "-o", str(tmp_path / "b.mp4")]) == 3
    assert "no subtitles in it: give them with --subtitles" in capsys.readouterr().err
    assert not (tmp_path / "b.mp4").exists()


def map_section(streams: bytes) -> bytes:
    """A PMT of programme 1 with its clock on PID 0x100."""
    body = b"\x00\x01\xc1\x00\x00\xe1\x00\xf0\x00" + streams
    section = b"\x02" + struct.pack(">H", 0xB000 | len(body) + 4) + body
    return section + struct.pack(">I", checksum(section))


def test_tables_name_what_a_stream_is() -> None:
    streams = b"".join(
        bytes([kind]) + struct.pack(">HH", 0xE000 | pid, 0xF000 | len(extra)) + extra
        for kind, pid, extra in [
            (0x1B, 0x100, b""),
            (0x0F, 0x101, b"\x0a\x04fra\x00"),
            (0x06, 0x102, b"\x6a\x01\x00\x0a\x04eng\x00"),
            (0x06, 0x103, b"\x59\x03fra"),
            (0x06, 0x104, b"\x56\x05fra\x10\x88"),
            (0x06, 0x105, b"\x7f\x06\x20fra\x00\x00"),
            (0x06, 0x106, b"\xfd\x03\x00\x08\x3d"),
            (0x05, 0x107, b""),
        ]
    )
    found = read_map(map_section(streams))
    assert found is not None
    assert found.pcr_pid == 0x100
    assert [(s.kind, s.language) for s in found.streams] == [
        ("video", ""), ("aac", "fra"), ("ac3", "eng"), ("dvb bitmaps", "fra"), ("teletext", "fra"),
        ("ttml", "fra"), ("arib captions", ""), ("data", ""),
    ]  # fmt: skip


def test_tables_of_a_written_stream(tmp_path: Path) -> None:
    data = make(tmp_path / "a.ts", [("ttml", "fra", each(str.encode))]).read_bytes()
    reader = TableReader()
    changes = [reader.process(data[at : at + 188]) for at in range(0, len(data), 188)]
    assert sum(changes) == 1
    assert reader.programme is not None
    assert [s.kind for s in reader.programme.streams] == ["video", "aac", "data"]
    damaged = bytearray(data)
    for at in range(0, len(data), 188):
        damaged[at + 20] ^= 0x55
    reader = TableReader()
    assert not any(reader.process(bytes(damaged[at : at + 188])) for at in range(0, len(data), 188))


def test_a_file_beside_goes_first(tmp_path: Path) -> None:
    path = tmp_path / "a.srt"
    path.write_text(SRT, encoding="utf-8")
    assert [s.text for s in read_subtitles(path)] == [text for _, _, text in LINES]


@pytest.mark.parametrize("late_s", [0.0, 0.4])
def test_captions_are_on_the_clock_of_players(tmp_path: Path, late_s: float) -> None:
    """Players count from the container's start, which is that of a sound before the picture."""
    suffix, coding, packets = CARRIED["mov_text"]
    film = make(tmp_path / f"a{suffix}", [(coding, "fra", packets)], late_s=late_s)
    captions = captions_of(film)
    assert captions is not None
    shown = parse_subtitles(captions.data)
    assert [(s.start_s, s.end_s, s.text) for s in shown] == LINES
    # Time codes count from the first picture.
    coded = SRT.replace("00:00:", "10:00:").encode()
    for data, begin_s in ((SRT.encode(), late_s), (coded, 0.0)):
        found = parse_subtitles(data, player_s=late_s)
        assert found[-1].start_s == pytest.approx(LINES[-1][0] - begin_s)
