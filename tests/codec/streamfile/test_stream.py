import contextlib
import json
import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.analysis.compare import Comparison, compare_motions
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.cueing import cue
from codec.cues.score import Phone, Score
from codec.errors import BitstreamError, CueError, VoiceError
from codec.streamfile.content import read_head, read_superframes
from codec.streamfile.inspect import describe, inspect_stream
from codec.streamfile.spread import MOST_COST, ScoreChoice
from codec.streamfile.stream import choose_stream, decode_stream, encode_stream
from codec.superframe.bits import FILE_BYTES, crc16
from codec.superframe.coding import coding_for
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text

MakeMotion = Callable[..., Motion]


@pytest.fixture(scope="module")
def make(toy_voice: Voice) -> MakeMotion:
    """Return smooth motion of any length and rate, with a score."""

    def motion(seconds: float, *, rate: float = 50.0, start: float = 0.0, seed: int = 0) -> Motion:
        times = start + np.arange(round(seconds * rate)) / rate
        rng = np.random.default_rng(seed)
        phase = rng.uniform(0, 6.28, len(toy_voice.layout))
        speed = rng.uniform(1, 6, len(toy_voice.layout))
        params = 0.3 * np.sin(times[:, None] * speed + phase)
        symbols = ["b", "a", "s", "i", "l", "y", "ʁ"]
        phones = [
            Phone(symbols[i % 7], round(start + 0.1 * i, 2), round(start + 0.1 * i + 0.1, 2))
            for i in range(int(10 * seconds) - 1)
        ]
        score = Score(tuple(phones), tuple(cue(phones)))
        return Motion(
            params.astype(np.float32), rate, start, toy_voice.layout, toy_voice.identity, score
        )

    return motion


@pytest.mark.parametrize("start", [0.0, 0.5, 7.36])
@pytest.mark.parametrize("rate", [25.0, 50.0, 120.0])
def test_round_trip(toy_voice: Voice, make: MakeMotion, rate: float, start: float) -> None:
    motion = make(3.0, rate=rate, start=start)
    decoded = decode_stream(encode_stream(motion, toy_voice, error_mm=2.0, score="keep"), toy_voice)
    assert decoded.rate_hz == 50
    assert decoded.start_s == pytest.approx(start)
    assert decoded.duration_s == pytest.approx(3.0)
    result = compare_motions(motion, decoded, toy_voice)
    # The grid of 50 Hz and the models' curvature add to the coder's own error.
    assert result.marker_rms_mm < 2.5
    assert result.keys_total == result.keys_correct > 10


@pytest.mark.parametrize("error_mm", [1.0, 4.0])
@pytest.mark.parametrize("seconds", [5.0, 6.7])
def test_an_error_is_met(
    toy_voice: Voice, make: MakeMotion, error_mm: float, seconds: float
) -> None:
    """Padding behind the motion's end does not count, whatever its length."""
    motion = make(seconds)
    data = encode_stream(motion, toy_voice, error_mm=error_mm, score="drop")
    found = compare_motions(motion, decode_stream(data, toy_voice), toy_voice).marker_rms_mm
    # Measured within .4 %; of 8 takes of a real cuer 7 within .3 %, one .8 %.
    assert found == pytest.approx(error_mm, rel=0.005)


@pytest.mark.parametrize("rate_bps", [140, 337.5, 1000, 6000, 20000])
def test_constant_rates_are_kept(toy_voice: Voice, make: MakeMotion, rate_bps: float) -> None:
    data = encode_stream(make(6.4), toy_voice, rate_bps=rate_bps, constant=True)
    sizes = {len(frame.l0) for frame in read_superframes(data)}
    assert len(sizes) == 1
    assert 0 <= rate_bps - 8 * sizes.pop() / 0.64 < 12.5


@pytest.mark.parametrize("score", ["auto", "keep", "drop"])
@pytest.mark.parametrize("rate_bps", [200, 337.5, 1000])
def test_mean_rates_are_kept_and_used(
    toy_voice: Voice, make: MakeMotion, rate_bps: float, score: ScoreChoice
) -> None:
    data = encode_stream(make(6.4), toy_voice, rate_bps=rate_bps, score=score)
    assert 0.9 * rate_bps < 8 * len(data) / 6.4 <= rate_bps
    assert len({len(frame.l0) for frame in read_superframes(data)}) > 2


def test_what_no_rate_can_hold_is_refused(toy_voice: Voice, make: MakeMotion) -> None:
    with pytest.raises(CueError, match="bytes do not hold 10 superframes"):
        encode_stream(make(6.4), toy_voice, rate_bps=60)


@pytest.mark.parametrize("wish", [{"error_mm": 4.0}, {"rate_bps": 250.0}, {"rate_bps": 900.0}])
def test_a_score_never_makes_a_file_worse(
    toy_voice: Voice, make: MakeMotion, wish: dict[str, float]
) -> None:
    """The motion of `make` has nothing to do with its score."""
    motion = make(6.4)
    plain = replace(motion, score=None)
    told = encode_stream(motion, toy_voice, **wish)  # type: ignore[arg-type]
    bare = encode_stream(plain, toy_voice, **wish)  # type: ignore[arg-type]
    if "error_mm" in wish:
        assert len(told) <= 1.01 * len(bare)
        return
    errors = [
        compare_motions(plain, decode_stream(data, toy_voice), toy_voice).marker_rms_mm
        for data in (told, bare)
    ]
    assert errors[0] <= 1.01 * errors[1]


@pytest.mark.parametrize(
    "wish", [{"error_mm": 4.0}, {"rate_bps": 150.0}, {"rate_bps": 337.5, "constant": True}]
)
def test_a_score_that_costs_is_left_out_unless_it_is_to_be_kept(
    toy_voice: Voice, make: MakeMotion, wish: dict[str, float]
) -> None:
    motion = make(6.4)
    auto = choose_stream(motion, toy_voice, **wish)  # type: ignore[arg-type]
    assert not auto.scored
    assert auto.score_cost is not None
    assert auto.score_cost > MOST_COST
    assert decode_stream(auto.data, toy_voice).score is None
    kept = choose_stream(motion, toy_voice, score="keep", **wish)  # type: ignore[arg-type]
    assert kept.scored
    score = decode_stream(kept.data, toy_voice).score
    assert score is not None
    assert motion.score is not None
    assert len(score.keys) == len(motion.score.keys)
    dropped = choose_stream(motion, toy_voice, score="drop", **wish)  # type: ignore[arg-type]
    assert dropped.data == auto.data


@pytest.mark.parametrize("wish", [{"error_mm": 4.0}, {"rate_bps": 337.5}, {"rate_bps": 150.0}])
def test_a_score_that_helps_is_kept(wish: dict[str, float]) -> None:
    voice = load_voice()
    motion = motion_of(score_of_text("Un bon vin blanc.", start_s=0.5), voice)
    auto = choose_stream(motion, voice, **wish)  # type: ignore[arg-type]
    assert auto.scored
    assert auto.score_cost is not None
    assert auto.score_cost < 0
    assert auto.data == encode_stream(motion, voice, score="keep", **wish)  # type: ignore[arg-type]


def test_what_was_not_left_to_the_encoder_has_no_cost(toy_voice: Voice, make: MakeMotion) -> None:
    motion = make(2.0)
    assert choose_stream(motion, toy_voice, score="drop").score_cost is None
    assert choose_stream(replace(motion, score=None), toy_voice).score_cost is None
    with pytest.raises(CueError, match="score 'some' is none of auto, keep, drop"):
        choose_stream(motion, toy_voice, score="some")  # type: ignore[arg-type]


def test_errors_shrink_with_the_limit(toy_voice: Voice, make: MakeMotion) -> None:
    motion = make(3.2)
    sizes = []
    for limit in (8.0, 2.0, 0.5):
        data = encode_stream(motion, toy_voice, error_mm=limit)
        found = compare_motions(motion, decode_stream(data, toy_voice), toy_voice).marker_rms_mm
        assert found < 1.1 * limit
        sizes.append(len(data))
    assert sizes == sorted(sizes)


def test_motion_without_a_score_stays_without(toy_voice: Voice, make: MakeMotion) -> None:
    motion = make(2.0)
    plain = Motion(motion.params, 50, 0.0, motion.layout, motion.voice)
    decoded = decode_stream(encode_stream(plain, toy_voice), toy_voice)
    assert decoded.score is None


def test_inspection_needs_no_voice(toy_voice: Voice, make: MakeMotion) -> None:
    motion = make(2.0)
    document = inspect_stream(
        encode_stream(motion, toy_voice, rate_bps=400, constant=True, score="keep")
    )
    assert motion.score is not None
    assert document["coding"] == coding_for(toy_voice).identity
    assert document["duration_s"] == 2.0
    assert len(document["superframes"]) == 4
    assert [k["phones"] for k in document["keys"]] == [list(k.phones) for k in motion.score.keys]
    assert json.loads(json.dumps(document)) == document
    text = describe(document).splitlines()
    assert len(text) == 6
    assert text[2].split()[:5] == ["0", "0.00", "score", "32+0", text[2].split()[4]]


def test_damage_is_concealed_and_reported(toy_voice: Voice, make: MakeMotion) -> None:
    data = bytearray(encode_stream(make(2.0), toy_voice, rate_bps=400, constant=True))
    data[FILE_BYTES + 2 + 32 + 5] ^= 1
    assert len(decode_stream(bytes(data), toy_voice).params) == 100
    document = inspect_stream(bytes(data))
    assert [row["intact"] for row in document["superframes"]] == [True, False, True, True]
    assert "damaged" in describe(document)


@pytest.mark.parametrize(
    ("change", "section"),
    [
        (lambda d: d[:10], "F1"),
        (lambda d: b"RIFF" + d[4:], "F2"),
        (lambda d: d[:4] + b"\7" + d[5:], "F3"),
        (lambda d: d[:18] + bytes([d[18] ^ 1]) + d[19:], "F4"),
        (lambda d: d[:-1], "F6"),
        (lambda d: d + b"\0", "F6"),
        (lambda d: b"", "F1"),
    ],
)
def test_broken_files(
    toy_voice: Voice, make: MakeMotion, change: Callable[[bytes], bytes], section: str
) -> None:
    data = change(encode_stream(make(1.0), toy_voice, rate_bps=300, constant=True))
    for read in (inspect_stream, lambda d: decode_stream(d, toy_voice)):
        with pytest.raises(BitstreamError) as caught:
            read(data)
        assert caught.value.section == section


@pytest.mark.parametrize(
    ("change", "section"),
    [
        (lambda d: d[:-1], "F7"),
        (lambda d: d[:40] + bytes([d[40] ^ 1]) + d[41:], "F7"),
        (lambda d: checked(d[:-6]), "F6"),
        (lambda d: checked(d[:-4] + b"x"), "F6"),
        (lambda d: checked(d[:26]), "F6"),
    ],
)
def test_broken_files_of_records(
    toy_voice: Voice, make: MakeMotion, change: Callable[[bytes], bytes], section: str
) -> None:
    data = change(encode_stream(make(1.0), toy_voice, rate_bps=600))
    with pytest.raises(BitstreamError) as caught:
        list(read_superframes(data))
    assert caught.value.section == section


@pytest.mark.parametrize(
    ("change", "cause", "rows"),
    [
        (lambda d: d, "", 4),
        (lambda d: d[: len(d) // 2], "the file is cut off", 1),
        (lambda d: d[:-20] + bytes([d[-20] ^ 4]) + d[-19:], "bytes of the file were changed", 4),
        (lambda d: d + b"hello", "5 bytes were appended", 4),
    ],
)
def test_a_damaged_file_is_shown_up_to_its_damage(
    toy_voice: Voice, make: MakeMotion, change: Callable[[bytes], bytes], cause: str, rows: int
) -> None:
    """Cut, changed or with bytes appended: what is readable, the rule and the likely cause."""
    whole = encode_stream(make(2.5), toy_voice, rate_bps=600, score="keep")
    document = inspect_stream(change(whole), partial=True)
    assert len(document["superframes"]) >= rows
    shown = document["superframes"]
    assert "changed" in cause or shown == inspect_stream(whole)["superframes"][: len(shown)]
    if not cause:
        assert "damage" not in document
        return
    assert document["damage"]["section"] == "F7"
    assert document["damage"]["cause"].startswith(cause)
    assert "spec/bitstream.md, F7" in describe(document)
    with pytest.raises(BitstreamError, match=cause):
        inspect_stream(change(whole))


@pytest.mark.parametrize(
    ("change", "section", "cause"),
    [
        (lambda d: d[:12], "F1", "the file is cut off"),
        (lambda d: bytes([d[0] ^ 2]) + d[1:], "F2", "bytes of the head were changed"),
        (lambda d: b"RIFF" + bytes(len(d)), "F2", "a file of another kind"),
        (lambda d: d[:4] + b"\x05" + d[5:], "F3", "bytes of the head were changed"),
        (lambda d: of_another_version(d), "F3", "a file of another version of Cuecast"),
        (lambda d: d[:9] + bytes([d[9] ^ 2]) + d[10:], "F4", "bytes of the head were changed"),
    ],
)
def test_a_damaged_head_is_shown_as_it_stands(
    toy_voice: Voice, make: MakeMotion, change: Callable[[bytes], bytes], section: str, cause: str
) -> None:
    data = change(encode_stream(make(1.0), toy_voice, rate_bps=600))
    document = inspect_stream(data, partial=True)
    assert (document["damage"]["section"], document["damage"]["cause"]) == (section, cause)
    assert document["head"].get("magic") == (
        int.from_bytes(data[:4], "big") if section != "F1" else None
    )
    assert f"likely cause: {cause}" in describe(document)


def of_another_version(data: bytes) -> bytes:
    head = data[:4] + bytes([data[4] + 1]) + data[5:24]
    return head + crc16(head).to_bytes(2, "big") + data[26:]


def checked(data: bytes) -> bytes:
    """Return a file of records with a valid check."""
    return data + zlib.crc32(data).to_bytes(4, "big")


@settings(max_examples=60)
@given(st.binary(max_size=200), st.integers(0, 200), st.booleans())
def test_any_bytes_give_a_motion_or_an_error(noise: bytes, at: int, behind: bool) -> None:
    data = bytearray(STREAMS[0])
    data[at : at + len(noise)] = noise if behind else noise[:3]
    for read in (inspect_stream, lambda d: decode_stream(d, VOICES[0])):
        with contextlib.suppress(BitstreamError, VoiceError):
            read(bytes(data))


STREAMS: list[bytes] = []
VOICES: list[Voice] = []


@pytest.fixture(autouse=True, scope="module")
def _keep(toy_voice: Voice, make: MakeMotion) -> None:
    STREAMS.append(encode_stream(make(2.0), toy_voice, error_mm=4.0))
    VOICES.append(toy_voice)


def test_impossible_wishes(toy_voice: Voice, make: MakeMotion) -> None:
    motion = make(1.0)
    for wish, message in (
        ({"rate_bps": 50}, r"rate 50 bit/s is not within 60\.\.20000"),
        ({"error_mm": 0.0}, r"error 0\.0 mm is not within"),
        ({"error_mm": 2, "constant": True}, "superframes of constant size need a rate"),
        ({"rate_bps": 300, "error_mm": 2}, "a rate and an error cannot both be given"),
    ):
        with pytest.raises(CueError, match=message):
            encode_stream(motion, toy_voice, **wish)
    early = Motion(motion.params, 50, -1.0, motion.layout, motion.voice)
    with pytest.raises(CueError, match="does not fit into a stream"):
        encode_stream(early, toy_voice)


def test_another_voice_is_refused(toy_voice: Voice, make: MakeMotion) -> None:
    data = encode_stream(make(1.0), toy_voice, rate_bps=600)
    assert read_head(data).coding == coding_for(toy_voice).identity
    other = Motion(np.zeros((9, 1), np.float32), 50, 0.0, ("face.1",), "0" * 16)
    with pytest.raises(CueError, match="voice 0000000000000000"):
        compare_motions(other, other, toy_voice)


def test_comparison_measures_what_it_says(toy_voice: Voice, make: MakeMotion) -> None:
    motion = make(4.0)
    assert motion.score is not None
    same = compare_motions(motion, motion, toy_voice)
    total = len([k for k in motion.score.keys if k.start < 3.9])
    assert same == Comparison(0.0, 0.0, 0.0, total, total, same.offset_s)
    assert abs(same.offset_s) < 1e-6
    late = Motion(motion.params, 50, 0.06, motion.layout, motion.voice, motion.score.shifted(0.06))
    shifted = compare_motions(motion, late, toy_voice)
    assert shifted.offset_s == pytest.approx(0.06, abs=0.003)
    assert shifted.keys_correct == shifted.keys_total
    wrong = Motion(motion.params, 50, 0.0, motion.layout, motion.voice, motion.score.shifted(0.2))
    assert compare_motions(motion, wrong, toy_voice).keys_correct < total
    apart = Motion(motion.params, 50, 100.0, motion.layout, motion.voice)
    with pytest.raises(CueError, match=r"have 0\.000 s in common"):
        compare_motions(motion, apart, toy_voice)
