"""Stream files against the reference that was written from the text: keys, lines and markers."""

import json
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codec.cuer.movement import Movement
from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENT_NUMBER
from codec.errors import BitstreamError
from codec.streamfile import stream
from codec.streamfile.content import common_data, read_head, read_superframes
from codec.streamfile.spread import ScoreChoice
from codec.streamfile.stream import decode_stream, encode_stream
from codec.superframe.coding import coding_for
from codec.superframe.merging import join_line
from codec.superframe.score_coding import part_of
from spec.reference import files
from spec.reference.stream_bytes import head, whole
from spec.reference.superframe import MalformedError
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text

VECTORS = Path(__file__).parents[2] / "spec" / "vectors" / "stream.json"
DOCUMENT = json.loads(VECTORS.read_text(encoding="utf-8"))
DRAWN = [case for case in DOCUMENT["cases"] if "markers" in case]


def file_of(case: dict[str, Any]) -> bytes:
    data = bytes.fromhex(case["file"])
    return zlib.decompress(data) if case.get("packed") else data


def all_of(data: bytes) -> None:
    list(read_superframes(data))
    common_data(data)


def line_of(data: bytes) -> tuple[list[list[int]] | None, list[list[int]]]:
    """Return phones and keys as the codec reads them."""
    told, indices = common_data(data), read_head(data).indices
    if told.line is None:
        return None, []
    line = told.line
    begin = 32 * indices.start - 33
    starts = [begin, *line.starts[1:]]
    parts = {k: part_of(line, k, told.options) for k in range(-1, indices.stop + 40)}
    keys = join_line(line, parts).every
    return (
        [[n, a] for n, a in zip(line.numbers, starts, strict=True)],
        [[6 * k.shape + PLACEMENT_NUMBER[k.placement], round(50 * k.start)] for k in keys],
    )


@pytest.mark.vectors("stream")
def test_vectors(case: dict[str, Any]) -> None:
    data = file_of(case)
    if not case["valid"]:
        with pytest.raises(MalformedError, match=case["section"]):
            files.read(data)
        with pytest.raises(BitstreamError) as caught:
            all_of(data)
        assert caught.value.section == case["section"]
        return
    found = files.read(data)
    assert found.line == case["line"]
    assert [[c.number, c.start, c.end] for c in files.keys(found)] == case["keys"]
    head = read_head(data)
    assert [head.first_tick, head.ticks, head.l0, head.l1] == case["span"]
    payloads = [(frame.l0 + frame.l1).hex() for frame in read_superframes(data)]
    assert payloads == case["payloads"] == [payload.hex() for payload in found.payloads]
    line, keys = line_of(data)
    assert line == (None if case["line"] is None else [phone[:2] for phone in case["line"]])
    assert keys == [key[:2] for key in case["keys"]]
    assert common_data(data).learning == case["learns"]


def test_a_line_of_one_silence_is_a_file_without_keys() -> None:
    voice = load_voice()
    (case,) = (case for case in DOCUMENT["cases"] if case["id"] == "one-silence")
    once = file_of(case)[27:][: file_of(case)[26]]
    identity = coding_for(voice).identity
    motion = decode_stream(whole(head(0, 128, identity), [once] + 4 * [b"\xfc"]), voice)
    assert motion.score is not None
    assert not motion.score.keys


@pytest.mark.parametrize("case", DRAWN, ids=lambda case: case["id"])
def test_markers(case: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    shown = DOCUMENT["shown"]
    voice = load_voice()
    if "movement" in case:
        own = coding_for(voice)
        late, movement = np.array(case["late"]), Movement(*case["movement"])
        other = replace(own, targets=replace(own.targets, movement=movement, late=late))
        object.__setattr__(other, "identity", case["coding"])
        monkeypatch.setattr(stream, "coding_for", lambda _: other)
    drawn = voice.reconstruct(decode_stream(file_of(case), voice).params)
    for t, points in case["markers"].items():
        assert np.abs(drawn[int(t)][shown] - np.array(points)).max() < 0.01


@pytest.mark.parametrize("score", ["auto", "keep"])
def test_a_file_of_the_encoder(score: ScoreChoice) -> None:
    """From bytes to keys by the reference alone."""
    voice = load_voice()
    motion = motion_of(score_of_text("Un bon vin blanc, puis du pain.", start_s=0.7), voice)
    data = encode_stream(motion, voice, rate_bps=500, score=score)
    again = decode_stream(data, voice)
    assert motion.score is not None
    assert again.score is not None
    found = files.keys(files.read(data))
    told = [6 * k.shape + PLACEMENT_NUMBER[k.placement] for k in motion.score.keys]
    assert [cue.number for cue in found] == told
    assert [str(key) for key in again.score.keys] == [str(key) for key in motion.score.keys]
