"""Stream files by the native receiver: keys, phones and motion of the toolkit's own decoder."""

import json
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENT_NUMBER
from codec.streamfile.stream import decode_stream
from receiver.export.device_voice import device_voice
from spec.reference.stream_bytes import head
from tests.receiver.native.building import built

VECTORS = Path(__file__).parents[3] / "spec" / "vectors" / "stream.json"
CASES = {case["id"]: case for case in json.loads(VECTORS.read_text(encoding="utf-8"))["cases"]}
FACE = 7
"""Parameters of the face, which section 5.1 changes for viewers."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("files")
    (path / "voice.bin").write_bytes(device_voice(load_voice()))
    return path


def read(folder: Path, data: bytes) -> tuple[int, list[dict[str, Any]], str]:
    (folder / "s.cue").write_bytes(data)
    command = [built("cue_dec"), "--voice", str(folder / "voice.bin"), "--file", "s.cue"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    return done.returncode, [json.loads(line) for line in done.stdout.splitlines()], done.stderr


def file_of(name: str) -> bytes:
    return bytes.fromhex(CASES[name]["file"])


@pytest.mark.parametrize("name", ["drawn-fixed", "drawn-learning"])
def test_a_file_gives_keys_and_motion(folder: Path, name: str) -> None:
    data = file_of(name)
    motion = decode_stream(data, load_voice())
    code, events, _ = read(folder, data)
    assert code == 0
    keys = [
        (round(50 * e["time_s"]), round(50 * e["duration_s"]), 6 * e["shape"] + e["placement"])
        for e in events
        if e["kind"] == "key"
    ]
    assert motion.score is not None
    assert keys == [
        (
            round(50 * k.start),
            round(50 * (k.end - k.start)),
            6 * k.shape + PLACEMENT_NUMBER[k.placement],
        )
        for k in motion.score.keys
    ]
    assert [e["phone"] for e in events if e["kind"] == "phone"] == [
        phone[0] for phone in CASES[name]["line"] if phone[0]
    ]
    frames = {round(50 * e["time_s"]): e["values"] for e in events if e["kind"] == "motion"}
    first = round(50 * motion.start_s)
    assert list(frames) == list(range(first, first + len(motion.params)))
    drawn = np.array(list(frames.values()))
    assert np.abs(drawn - motion.params)[:, FACE:].max() < 1e-2
    assert np.abs(drawn - motion.params)[:, :FACE].max() > 0


@pytest.mark.parametrize("name", ["drawn-without-score", "drawn-number-0"])
def test_frames_outside_of_the_file_are_not_reported(folder: Path, name: str) -> None:
    whole = file_of(name)
    start = head(39, 80, whole[5:13].hex(), int.from_bytes(whole[21:24], "big"))
    if name == "drawn-number-0":
        n0 = whole[21] << 4 | whole[22] >> 4
        data = start + whole[26 : 26 + 3 * n0]
    else:
        data = start + whole[26:-4]
        data += zlib.crc32(data).to_bytes(4, "big")
    _, events, _ = read(folder, data)
    ticks = sorted({round(50 * e["time_s"]) for e in events if e["kind"] == "motion"})
    assert ticks == list(range(39, 39 + 80))


def test_what_is_no_file_is_explained(folder: Path) -> None:
    data = file_of("drawn-fixed")
    other = head(32, 96, 16 * "0") + data[26:-4]
    for wrong, words in (
        (b"<html>not found</html>", "violates F1"),
        (b"<html>" + bytes(50), "violates F2"),
        (data[:-2], "violates F7"),
        (data[:5] + bytes(8) + data[13:], "violates F4"),
        (other + zlib.crc32(other).to_bytes(4, "big"), "the voice that it was made with"),
    ):
        code, events, error = read(folder, wrong)
        assert (code, events) == (3, [])
        assert words in error
