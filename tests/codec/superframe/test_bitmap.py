"""The bit map of a superframe: it covers every bit, and says what the stream says."""

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.errors import BitstreamError
from codec.streamfile.content import read_superframes
from codec.streamfile.inspect import describe_bits, inspect_stream
from codec.streamfile.stream import encode_stream
from codec.superframe.bitmap import map_superframe
from codec.superframe.superframe import Superframe
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text


@pytest.fixture(scope="module", params=[87.5, 337.5])
def stream(request: pytest.FixtureRequest) -> bytes:
    voice = load_voice()
    motion = motion_of(score_of_text("Bonsoir à tous, et merci.", start_s=0.5), voice)
    return encode_stream(motion, voice, rate_bps=request.param, constant=True)


def test_the_fields_cover_all_bits(stream: bytes) -> None:
    for frame in read_superframes(stream):
        fields = map_superframe(frame)
        for part, data in (("L0", frame.l0), ("L1", frame.l1)):
            own = [field for field in fields if field.part == part]
            assert sum(field.bits for field in own) == pytest.approx(8 * len(data), abs=1e-9)
            ends = np.cumsum([field.bits for field in own])
            np.testing.assert_allclose([field.first for field in own][1:], ends[:-1], atol=1e-9)
        assert all(field.name and field.paragraph for field in fields)


def test_the_map_says_what_the_stream_says(stream: bytes) -> None:
    rows = inspect_stream(stream)["superframes"]
    for frame, row in zip(read_superframes(stream), rows, strict=True):
        fields = {field.name: field.value for field in map_superframe(frame)}
        letters = {field.value for field in map_superframe(frame) if field.name == "letter"}
        assert set(row["phones"]) <= letters
        assert int(fields["sequence"]) in (frame.index % 64, frame.index % 16)


def test_it_prints_in_colour_and_without(stream: bytes) -> None:
    frame = next(iter(read_superframes(stream)))
    plain, painted = describe_bits(frame), describe_bits(frame, colour=True)
    assert "\x1b" not in plain
    for code in ("\x1b[0m", *(f"\x1b[{n}m" for n in range(31, 37))):
        painted = painted.replace(code, "")
    assert painted == plain
    bits = "".join(
        line[8:].replace(" ", "")
        for line in plain.splitlines()
        if line[2:7].strip().isdigit() and set(line[8:]) <= set("01 ")
    )
    assert bits == "".join(f"{byte:08b}" for byte in frame.l0 + frame.l1)


def test_a_damaged_superframe_has_no_map() -> None:
    with pytest.raises(BitstreamError, match="superframe 3: its L0 is damaged"):
        describe_bits(Superframe(3, bytes(4), b""))
