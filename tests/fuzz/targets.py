"""What can come in from outside, as functions of bytes: each raises `CueError` or nothing.

A target is given bytes and does what a user of that input would do. Seeds are real inputs in small.
"""

import contextlib
import io
import json
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from unittest import mock

import av
import numpy as np
from numpy.lib import format as npy

from codec.authentication.announcement import (
    Announcement,
    SigningKey,
    load_announcement,
    load_signing_key,
)
from codec.authentication.layout import EPOCH_S
from codec.authentication.signer import Signer
from codec.authentication.verifier import Verifier
from codec.cuer.motion import load_motion, save_motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Score
from codec.files.c3d_points import open_c3d
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.lips import LipContract
from cuecast.command import cli
from receiver.live.broadcast import Broadcast
from receiver.live.fragments import BoxSplitter
from receiver.media.programme import open_programme
from receiver.media.sound import SoundDecoder, sound_blocks
from receiver.reception.tracking import TimelineTracker
from receiver.television.protocol import pack_event, parse_position
from synth.capture.points.labels import read_map
from synth.capture.sources.readers import read_points
from synth.capture.sources.sniff import kind_of
from synth.language.subtitles.read import parse_subtitles
from synth.planning.scoring.textgrid import read_textgrid, write_textgrid
from tests.codec.quick_search import quick_search
from tests.fuzz.archive import inputs
from tests.fuzz.consume import consume

SUPERFRAMES = 24


@dataclass(frozen=True, slots=True)
class Target:
    """A way in: seeds to begin with, what takes them, and the modules whose coverage is told."""

    seeds: Callable[[], list[bytes]]
    run: Callable[[bytes], object]
    rooms: tuple[str, ...]
    text: bool = False


@cache
def voice() -> Voice:
    return load_voice()


def voice_called(name: str = "claire") -> Voice:
    """As `load_voice`, quicker the second time."""
    return voice() if name == "claire" else load_voice(name)


@cache
def contract() -> LipContract:
    return LipContract(voice())


parser = cache(cli.build_parser)
"""All of the command line, built once."""


@contextlib.contextmanager
def as_file(data: bytes, suffix: str = "") -> Iterator[str]:
    with tempfile.NamedTemporaryFile(suffix=suffix) as file:
        file.write(data)
        file.flush()
        yield file.name


def of_file(read: Callable[[str], object], suffix: str = "") -> Callable[[bytes], object]:
    def run(data: bytes) -> object:
        with as_file(data, suffix) as path:
            return read(path)

    return run


@cache
def superframes() -> list[tuple[bytes, bytes]]:
    from tests.receiver.standin import make_motion

    encoder = SuperframeEncoder(voice(), l0_bytes=20, l1_bytes=7)
    motion = make_motion(voice(), duration_s=SUPERFRAMES * 0.64 + 1)
    sent = (encoder.encode(motion, index) for index in range(SUPERFRAMES))
    return [(s.l0, s.l1) for s in sent]


def track(data: bytes) -> None:
    """Superframes on a bad line: each step of four bytes says what comes, and when."""
    with mock.patch("codec.superframe.decoder.LipContract", return_value=contract()):
        _track(data)


def _track(data: bytes) -> None:
    tracker, on_air_s = TimelineTracker(voice()), 0.0
    for at in range(0, min(len(data), 64) - 3, 4):
        kind, which, place, jump = data[at : at + 4]
        l0, l1 = superframes()[which % SUPERFRAMES]
        on_air_s += 0.64 + (jump / 16 if kind & 16 else 0.0) + (3600.0 if kind & 32 else 0.0)
        if kind & 64:
            on_air_s -= jump / 4
        wounded = bytearray(l0)
        if kind & 1:
            wounded[place % len(wounded)] ^= jump | 1
        given = None if kind & 2 else bytes(wounded)[: None if kind & 4 else place % 24]
        found = [*tracker.take(given, l1 if kind & 8 else None, on_air_s)]
        found += tracker.advance(on_air_s + 0.1)
        assert len(found) <= 64, f"{len(found)} events for one superframe"
        for event in found:
            pack_event(event)
    list(tracker.finish())


@cache
def signing_key() -> SigningKey:
    return SigningKey("fuzz", b"f" * 32)


@cache
def keys() -> list[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        signing_key().save(f"{folder}/s")
        signing_key().announce(EPOCH_S, 1).save(f"{folder}/p")
        return [Path(f"{folder}/{name}").read_bytes() for name in "sp"]


def read_keys(path: str) -> None:
    """Both kinds of key file, one after the other."""
    with contextlib.suppress(Exception):
        load_signing_key(path)
    try:
        load_announcement(path)
    finally:
        load_signing_key(path)


@cache
def announced() -> Announcement:
    return signing_key().announce(EPOCH_S, 1)


@cache
def signed(width: int) -> list[tuple[bytes, int]]:
    """A genuine programme of some blocks: what is covered, and the fields."""
    signer = Signer(signing_key(), EPOCH_S + 100.0, width)
    covered = [bytes([number % 256, width]) * 4 for number in range(120)]
    return [(data, signer.take(data)) for data in covered]


def verify(data: bytes) -> None:
    """A genuine programme with losses, changes, jumps, and clocks that are wrong."""
    with quick_search(signing_key(), announced().periods):
        _verify(data)


def _verify(data: bytes) -> None:
    width = 2 if data[:1] == b"\2" else 9
    sent = signed(width)
    verifier = Verifier(announced(), likely_s=(EPOCH_S,))
    index = at = told = 0
    for step, value in zip(data[1:400:2], data[2:400:2], strict=False):
        kind = step % 16
        index += 1 + (value if kind == 1 else 0)
        at = (at + 1 + (value if kind == 2 else index - at if kind == 3 else 0)) % len(sent)
        covered, field = sent[at]
        whole = bytes([value]) * (value >> 4) if kind == 4 else None if kind == 5 else covered
        proof = (value % (1 << width), width) if kind == 6 else (field, width)
        other = (value % 4, 2) if kind == 7 else None if kind == 8 else proof
        clock = EPOCH_S + 100.0 + at * 0.64 + (value * 10 if kind == 9 else 0)
        verdicts = verifier.take(index, whole, other, utc_s=clock if data[0] & 4 else None)
        told += len(verdicts)
    assert told + len(verifier.finish()) <= len(data)


@cache
def transport() -> bytes:
    from tests.receiver.air import transport_stream

    noise = np.random.default_rng(1).normal(0, 0.05, (48000, 1)).astype(np.float32)
    return transport_stream(noise, fps=25, size=(48, 32))


@cache
def sound_alone() -> bytes:
    """A transport stream without a picture: that of the other one left out."""
    made = io.BytesIO()
    with av.open(io.BytesIO(transport()), "r") as old, av.open(made, "w", "mpegts") as new:
        stream = new.add_stream_from_template(old.streams.audio[0])
        for packet in old.demux(audio=0):
            if packet.dts is not None:
                packet.stream = stream
                new.mux(packet)
    return made.getvalue()


def live(data: bytes) -> None:
    """A broadcast that breaks off: never a trace, and the thread would go on."""
    Broadcast(io.BytesIO(data), voice(), lambda happening: None, format="mpegts", once=True).run()


def media(path: str) -> None:
    with open_programme(path) as programme:
        decoder = SoundDecoder(programme, strict=False)
        for number, _ in enumerate(sound_blocks(decoder, programme)):
            if number > 2000:
                break


@cache
def films() -> list[bytes]:
    made = [transport()]
    for form in ("matroska", "mp4"):
        file = io.BytesIO()
        with av.open(io.BytesIO(transport()), "r") as old, av.open(file, "w", form) as new:
            streams = {s.index: new.add_stream_from_template(s) for s in old.streams}
            for packet in old.demux():
                if packet.dts is not None:
                    packet.stream = streams[packet.stream.index]
                    new.mux(packet)
        made.append(file.getvalue())
    return made


def boxes(data: bytes) -> None:
    splitter = BoxSplitter()
    for at in range(0, len(data), 7):
        splitter.write(data[at : at + 7])
        splitter.take()


def command(data: bytes) -> None:
    """A command line: words between zeros, and a file that they may name."""
    words, _, content = data.partition(b"\n")
    argv = [word.decode("utf-8", "replace") for word in words.split(b"\0")][:12]
    out, told = io.TextIOWrapper(io.BytesIO()), io.StringIO()
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),
        as_file(content) as path,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(told),
        mock.patch.object(cli, "build_parser", parser),
        mock.patch("codec.cuer.voice.load_voice", voice_called),
        mock.patch("cuecast.command.voices.load_voice", voice_called),
    ):
        argv = [path if word == "@" else word for word in argv]
        verb = next((word for word in argv if not word.startswith("-")), "")
        if verb in ("demo", "evaluate", "batch", "watch", "synth", "dub", "render"):
            argv = [*argv, "--help"]  # these make or wait for more than a word can ask
        status = cli.main(argv)
    assert status in (0, 1, 2, 3), f"exit status {status}"
    lines = [line for line in told.getvalue().splitlines() if line.startswith("cuecast: ")]
    assert len(lines) <= 1, "more than one line of error"
    assert "\x1b" not in told.getvalue()


@cache
def motions() -> list[bytes]:
    from tests.receiver.standin import make_motion

    with tempfile.TemporaryDirectory() as folder:
        save_motion(make_motion(voice(), duration_s=1.0), f"{folder}/m")
        whole = Path(f"{folder}/m").read_bytes()
    plain = io.BytesIO()
    with zipfile.ZipFile(plain, "w") as archive:
        for name in ("params", "rate_hz"):
            header = io.BytesIO()
            npy.write_array(header, np.zeros((3, 2)), version=(2, 0))
            archive.writestr(f"{name}.npy", header.getvalue())
    return [whole, plain.getvalue()]


def c3d_frames(path: str) -> None:
    points = open_c3d(path)
    points.frames(0, min(points.n_frames, 100))


def points_of(path: str) -> None:
    kind = kind_of(path)
    if kind in ("trc", "tsv", "csv"):
        read_points(path, kind)


@cache
def recordings() -> list[bytes]:
    from tests.synth import studio_files

    rng = np.random.default_rng(2)
    markers = rng.normal(0, 100, (3, 113, 3))
    return [studio_files.trc(markers).encode(), studio_files.tsv(markers).encode()]


def c3d_seeds() -> list[bytes]:
    from tests.codec.files.test_c3d_points import DEC, INTEL, MIPS, c3d

    points = np.arange(60.0).reshape(5, 4, 3)
    return [c3d(points, processor=p, long=p == MIPS) for p in (INTEL, DEC, MIPS)]


def subtitle_seeds() -> list[bytes]:
    return [
        "1\n00:00:01,000 --> 00:00:02,500\nBonjour, ça va ?\n\n2\n00:00:03,000 --> 00:00:04,000\n"
        "<i>Très</i> bien {\\an8}\n".encode(),
        b"WEBVTT\n\nNOTE x\n\n00:01.000 --> 00:02.000 align:start\n<v Anne>Bonjour</v>\n",
        b'<?xml version="1.0"?><tt xmlns="http://www.w3.org/ns/ttml" xml:lang="fr"><body><div>'
        b'<p begin="00:00:01.000" end="00:00:02.000">Bon<br/>jour</p></div></body></tt>',
        struct.pack("3s8s", b"850", b"STL25.01") + b" " * 1013 + bytes(128),
        "[Events]\nFormat: Start, End, Text\nDialogue: 0:00:01.00,0:00:02.00,Oui\n".encode(
            "utf-16"
        ),
    ]


def textgrid_seeds() -> list[bytes]:
    from synth.planning.scoring.text_score import score_of_text

    with tempfile.TemporaryDirectory() as folder:
        write_textgrid(f"{folder}/t", score_of_text("Bonjour."), 3.0)
        return [Path(f"{folder}/t").read_bytes()]


def command_seeds() -> list[bytes]:
    lines = [
        "keys\0Bonjour.\0--json", "keys\0--file\0@\0--json", "inspect\0@", "decode\0@\0-o\0-",
        "compare\0@\0@\0--json", "encode\0@\0-o\0-", "receive\0@\0--json", "key\0show\0@",
        "capture\0@\0-o\0m.npz", "voice\0info\0@", "receive\0@\0--track\0001\0--start\0005",
    ]  # fmt: skip
    return [line.encode() + b"\n" + content for line in lines for content in (b"", motions()[0])]


TARGETS: dict[str, Target] = {
    "superframes": Target(
        lambda: list(inputs("superframes", "seeds").values()),
        consume,
        ("codec/superframe", "codec/streamfile"),
    ),
    "tracker": Target(
        lambda: [*(bytes(range(i, i + 64)) for i in (0, 40, 90, 160)), bytes(64)],
        track,
        ("receiver/reception/tracking.py",),
    ),
    "proofs": Target(
        lambda: [bytes([first]) + bytes(2 * 60) for first in (2, 4, 9)],
        verify,
        ("codec/authentication/verifier.py",),
    ),
    "keys": Target(keys, of_file(read_keys), ("codec/authentication/announcement.py",), text=True),
    "live": Target(
        lambda: [transport()[: 188 * 40], sound_alone()[: 188 * 24]], live, ("receiver/live",)
    ),
    "media": Target(films, of_file(media), ("receiver/media",)),
    "boxes": Target(lambda: [b"\0\0\0\x09freex" * 3], boxes, ("receiver/live/fragments.py",)),
    "protocol": Target(
        lambda: [json.dumps({"type": "position", "time_s": 4.5, "jumped": False}).encode()],
        lambda data: parse_position(data.decode("utf-8", "replace")),
        ("receiver/television/protocol.py",),
        text=True,
    ),
    "motions": Target(
        motions, of_file(load_motion), ("codec/cuer/motion.py", "codec/files/npz.py")
    ),
    "scores": Target(
        lambda: [Score((), ()).to_json().encode()],
        lambda data: Score.from_json(data.decode("utf-8", "replace")),
        ("codec/cues/score.py",),
        text=True,
    ),
    "c3d": Target(c3d_seeds, of_file(c3d_frames), ("codec/files/c3d_points.py",)),
    "points": Target(recordings, of_file(points_of), ("synth/capture/sources",), text=True),
    "subtitles": Target(
        subtitle_seeds, lambda data: parse_subtitles(data), ("synth/language/subtitles",), text=True
    ),
    "textgrids": Target(
        textgrid_seeds, of_file(read_textgrid), ("synth/planning/scoring/textgrid.py",), text=True
    ),
    "maps": Target(
        lambda: [b'{"a": "FH0"}', b"a,FH0\nb,NB\n"],
        of_file(read_map),
        ("synth/capture/points/labels.py",),
        text=True,
    ),
    "command": Target(command_seeds, command, ("cuecast/command", "cuecast/verbs"), text=True),
}
