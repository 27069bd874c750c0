from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.phonology import CONSONANTS, VOWELS
from codec.cues.score import Key, Phone, Score
from codec.cues.timeline import TICK_S, TICKS, to_line
from codec.errors import BitstreamError, CueError, VoiceError
from codec.superframe import _steering
from codec.superframe.bits import COMPACT, Header, identity_bits, read_header
from codec.superframe.checks import compact_identity, is_possible
from codec.superframe.coding import coding_for
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.merging import score_of
from codec.superframe.payload import read_beginning
from codec.superframe.superframe import DecodedSuperframe, ScoreMerger, merge_scores
from codec.superframe.window import (
    CORRECTIONS,
    EARLIEST,
    LAST,
    MAX_BYTES,
    MIN_BYTES,
    Window,
    read_window,
)
from codec.superframe.window_writer import WindowWriter, _agrees
from tests.codec.speech import SENTENCE, spoken

IDENTITY = "0123456789abcdef"
Ints = NDArray[np.int64]


def windows_of(
    score: Score, size: int, options: CueingOptions = DEFAULT_OPTIONS
) -> dict[int, Window]:
    line = to_line(score, options)
    writer = WindowWriter(line, options, IDENTITY, size)
    last = line.starts[-1] // TICKS
    return {k: read_window(writer.l0(k)) for k in range(-1, last + 2)}


@st.composite
def lines(draw: st.DrawFn) -> Score:
    """Syllables of any sounds, at the pace of slow speech, with and without gaps."""
    tick, phones = draw(st.integers(0, 50)), []
    for _ in range(draw(st.integers(1, 12))):
        tick += draw(st.sampled_from([0, 0, 0, 0, 6, 30, 90]))
        for symbol in draw(st.tuples(st.sampled_from(CONSONANTS), st.sampled_from(VOWELS))):
            end = tick + draw(st.integers(6, 30))
            phones.append(Phone(symbol, tick * TICK_S, end * TICK_S))
            tick = end
    phones = phones[draw(st.integers(0, 1)) :]
    return Score(tuple(phones), tuple(cue(phones)))


def names(score: Score) -> list[tuple[tuple[str, ...], str]]:
    return [(key.phones, str(key)) for key in score.keys]


@settings(max_examples=60)
@given(lines())
def test_twelve_bytes_keep_every_key_and_its_time(score: Score) -> None:
    windows = windows_of(score, 12)
    got = score_of(windows)
    assert names(got) == names(score)
    for sent, found in zip(score.keys, got.keys, strict=True):
        assert abs(sent.start - found.start) < 0.101


@pytest.mark.parametrize("size", [7, 9, 12])
def test_usual_speech_fits(size: int) -> None:
    score = spoken(10 * SENTENCE)
    assert names(score_of(windows_of(score, size))) == names(score)


def test_a_window_begins_and_ends_within_its_limits() -> None:
    for size in range(MIN_BYTES, MAX_BYTES + 1):
        for window in windows_of(spoken(6 * SENTENCE, 0.06), size).values():
            if window.numbers:
                assert EARLIEST <= window.begin <= LAST
                assert window.starts[-1] <= LAST
                assert window.end <= LAST + TICKS


def test_options_travel() -> None:
    options = CueingOptions(un="cheek", schwa="cheek")
    phones = [Phone("l", 1.0, 1.1), Phone("ə", 1.1, 1.2), Phone("œ̃", 1.2, 1.3)]
    score = Score(tuple(phones), tuple(cue(phones, options)))
    got = score_of(windows_of(score, 7, options))
    assert [key.placement for key in got.keys] == ["cheek", "cheek"]


def test_writers_give_the_same_in_any_order() -> None:
    line = to_line(spoken(4 * SENTENCE))
    one, other = (WindowWriter(line, DEFAULT_OPTIONS, IDENTITY, 7) for _ in range(2))
    numbers = range(-3, 25)
    assert {k: one.l0(k) for k in numbers} == {k: other.l0(k) for k in reversed(numbers)}


def test_a_lost_window_makes_no_key_wrong() -> None:
    score = spoken(6 * SENTENCE)
    windows = windows_of(score, 7)
    for lost in [k for k, window in windows.items() if window.numbers]:
        got = names(score_of({k: w for k, w in windows.items() if k != lost}))
        sent = iter(names(score))
        assert all(key in sent for key in got)
        assert len(got) < len(score.keys)


@given(st.binary(min_size=MIN_BYTES - 1, max_size=MAX_BYTES - 1), st.integers(0, 15))
def test_any_bytes_are_a_window(payload: bytes, sequence: int) -> None:
    l0 = Header(COMPACT, sequence, 2).to_bytes() + payload
    assert is_possible(l0)
    content = read_beginning(l0)
    assert isinstance(content.part, Window)
    starts = (*content.part.starts, content.part.end)
    assert list(starts) == sorted(set(starts))
    assert score_of({sequence: content.part}).keys is not None


@pytest.mark.parametrize("size", [MIN_BYTES - 1, MAX_BYTES + 1])
def test_other_sizes_are_malformed(size: int) -> None:
    l0 = Header(COMPACT, 3, 2).to_bytes() + bytes(size - 1)
    assert not is_possible(l0)
    with pytest.raises(BitstreamError, match=f"compact L0 of {size} bytes") as caught:
        read_beginning(l0)
    assert caught.value.section == "H1"


Resting = Callable[[Score | None], Motion]


@pytest.fixture
def motion(resting: Resting) -> Motion:
    return resting(spoken(SENTENCE))


@pytest.fixture
def resting(toy_voice: Voice) -> Resting:
    def make(score: Score | None) -> Motion:
        blank = np.zeros((256, len(toy_voice.layout)), np.float32)
        return Motion(blank, 50, 0.0, toy_voice.layout, toy_voice.identity, score)

    return make


def test_keys_pass_through_encoder_and_decoder(toy_voice: Voice, motion: Motion) -> None:
    encoder, decoder = (CompactEncoder(toy_voice, l0_bytes=7), SuperframeDecoder(toy_voice))
    decoded = [decoder.push(encoder.encode(motion, k).l0, None, k) for k in range(8)]
    assert motion.score is not None
    assert names(merge_scores(decoded)) == names(motion.score)
    assert {frame.lead for frame in decoded} == {2}
    merger, keys = ScoreMerger(), list[Key]()
    for frame in decoded:
        keys += merger.add(frame)
    keys += merger.flush()
    assert [str(key) for key in keys] == [str(key) for key in motion.score.keys]


@pytest.mark.parametrize(
    ("numbers", "starts", "end", "agrees"),
    [
        ((3, 20), (40, 46), 60, True), ((3, 20), (40, 46), 64, True), ((3, 20), (40, 46), 56, True),
        ((3, 20), (40, 46), 65, False), ((3, 20), (40, 46), 55, False),
        ((3,), (40,), 46, True), ((4,), (40,), 46, False), ((3,), (41,), 46, False),
        ((3, 20, 5, 6), (40, 46, 60, 70), 80, False), ((3, 20, 5), (40, 46, 60), 72, True),
    ],
)  # fmt: skip
def test_a_window_agrees_with_what_is_meant(
    numbers: tuple[int, ...], starts: tuple[int, ...], end: int, agrees: bool
) -> None:
    meant = [(3, 40, 46, 0), (20, 46, 60, 0), (5, 60, 70, 0)]
    assert _agrees(Window(starts[0], end, numbers, starts), meant) is agrees


@pytest.mark.parametrize("ticks", [2, 3])
@pytest.mark.parametrize("size", [4, 6, 7])
@pytest.mark.parametrize("seed", range(3))
def test_speech_that_no_window_keeps_up_with_loses_keys_and_shows_no_other(
    seed: int, size: int, ticks: int
) -> None:
    """A consonant whose vowel is left out would be another key, and so would it with the next."""
    rng = np.random.default_rng(seed)
    phones, tick = [], 5
    for k in range(160):
        kind = VOWELS if (k % 2 if seed else rng.random() < 0.5) else CONSONANTS
        phones.append(Phone(str(rng.choice(list(kind))), tick * TICK_S, (tick + ticks) * TICK_S))
        tick += ticks
    score = Score(tuple(phones), tuple(cue(phones)))
    windows = windows_of(score, size)
    assert all(w.begin >= EARLIEST for w in windows.values() if w.numbers)
    keys = score_of(windows).keys
    assert 3 < len(keys) < len(score.keys)
    for key in keys:
        near = [k for k in score.keys if abs(k.start - key.start) < 0.41]
        assert (key.phones, str(key)) in [(k.phones, str(k)) for k in near]


@pytest.mark.parametrize("seed", range(6))
def test_keys_come_out_whole_however_far_windows_run_ahead(seed: int) -> None:
    """A window of slow speech tells keys of the fourth superframe after its own."""
    rng = np.random.default_rng(seed)
    tick, phones = 3, []
    for _ in range(40):
        begin = tick + int(rng.choice([0, 0, 0, 6, 20, 40]))
        kind = CONSONANTS if rng.random() < 0.55 else VOWELS
        tick = begin + int(rng.integers(3, 30))
        phones.append(Phone(str(rng.choice(list(kind))), begin * TICK_S, tick * TICK_S))
    windows = windows_of(Score(tuple(phones), tuple(cue(phones))), 12)
    merger, keys = ScoreMerger(), list[Key]()
    nothing = np.zeros((0, 0), np.float32)
    for k, part in sorted(windows.items()):
        keys += merger.add(
            DecodedSuperframe(k, 0.64 * k, nothing, (), (), ("L0",), False, part, 2, k % 64)
        )
    assert tuple(keys + merger.flush()) == score_of(windows).keys


def test_every_superframe_tells_two_bits_of_the_identity(toy_voice: Voice, motion: Motion) -> None:
    encoder = CompactEncoder(toy_voice, l0_bytes=7)
    told = [compact_identity(encoder.encode(motion, k).l0) for k in range(8)]
    identity = coding_for(toy_voice).identity
    assert told == [identity_bits(identity, k) for k in range(8)]
    assert int("".join(f"{bits:02b}" for bits in told), 2) == int(identity[:4], 16)
    l0 = encoder.encode(motion, 1).l0
    with pytest.raises(VoiceError, match="another voice, language or coding tables"):
        SuperframeDecoder(toy_voice).push(l0[:-1] + bytes([l0[-1] ^ 1]), None, 1)


def test_numbers_count_modulo_sixteen(toy_voice: Voice, motion: Motion) -> None:
    l0 = CompactEncoder(toy_voice, l0_bytes=7).encode(motion, 18).l0
    assert read_header(l0).sequence == 2
    assert SuperframeDecoder(toy_voice).push(l0, None, 34).sequence == 34
    with pytest.raises(BitstreamError, match="sequence number 2, superframe 19 has 3"):
        SuperframeDecoder(toy_voice).push(l0, None, 19)


def test_what_cannot_be_compact_is_refused(toy_voice: Voice, resting: Resting) -> None:
    with pytest.raises(CueError, match="compact superframe of 13 bytes"):
        CompactEncoder(toy_voice, l0_bytes=13)
    encoder = CompactEncoder(toy_voice, l0_bytes=7)
    with pytest.raises(CueError, match="a compact superframe holds a score, the motion has none"):
        encoder.encode(resting(None), 0)


def test_fast_speech_keeps_its_keys_at_six_bytes_because_windows_run_ahead() -> None:
    """Ten superframes of eleven phones a second amid slow speech: 75 bit/s."""
    symbols = [s for s in SENTENCE if s != "_"]
    fast = spoken(3 * symbols, 0.09, 3.0)
    slow = spoken(symbols, 0.16, fast.phones[-1].end + 1.0)
    score = Score(fast.phones + slow.phones, fast.keys + slow.keys)
    windows = windows_of(score, 6)
    assert names(score_of(windows)) == names(score)
    assert max(window.begin for window in windows.values()) > TICKS


@settings(max_examples=60)
@given(lines(), st.integers(MIN_BYTES, 7), st.sampled_from([0.2, 0.4, 1.0]))
def test_speech_of_any_pace_gives_parts_of_the_size(score: Score, size: int, pace: float) -> None:
    phones = tuple(Phone(p.symbol, pace * p.start, pace * p.end) for p in score.phones)
    writer = WindowWriter(to_line(Score(phones, ())), DEFAULT_OPTIONS, IDENTITY, size)
    assert {len(writer.l0(k)) for k in range(30)} == {size}


def test_a_window_that_holds_no_phone_is_empty() -> None:
    """Sounds that four bytes cannot hold: the parts still have their size."""
    score = spoken(["ŋ"] * 12, 0.4)
    writer = WindowWriter(to_line(score), DEFAULT_OPTIONS, IDENTITY, MIN_BYTES)
    assert {len(writer.l0(k)) for k in range(12)} == {MIN_BYTES}


def test_a_long_consonant_keeps_its_vowel_in_the_next_window() -> None:
    """A consonant of half a second may end a window: its vowel, no pause being told, goes on."""
    lengths = (0.06, 0.08, 0.5, 0.1)
    phones, time_s = list[Phone](), 1.0
    for symbol, length_s in zip(12 * ("t", "a", "k", "u"), 12 * lengths, strict=True):
        phones.append(Phone(symbol, time_s, time_s + length_s))
        time_s += length_s
    score = Score(tuple(phones), tuple(cue(phones)))
    for size in (7, 8, 9):
        assert names(score_of(windows_of(score, size))) == names(score)


def test_a_long_vowel_does_not_draw_the_next_key_near() -> None:
    phones = [
        Phone("m", 1.0, 1.1),
        Phone("a", 1.1, 2.6),
        Phone("l", 2.6, 2.7),
        Phone("i", 2.7, 2.8),
    ]
    score = Score(tuple(phones), tuple(cue(phones)))
    for size in (7, 12):
        got = score_of(windows_of(score, size)).keys
        assert [round(key.start, 1) for key in got] == [1.0, 2.6]


def test_keys_that_windows_far_ahead_told_are_drawn_and_given_out(
    toy_voice: Voice, resting: Resting
) -> None:
    """Where little is said, a window runs four superframes ahead of a phone's end."""
    symbols = [s for s in SENTENCE if s != "_"]
    score = spoken(symbols, 0.3, 1.0)
    motion = replace(resting(score), params=np.zeros((600, len(toy_voice.layout)), np.float32))
    encoder = CompactEncoder(toy_voice, l0_bytes=12)
    decoder, merger, keys, done = SuperframeDecoder(toy_voice), ScoreMerger(), list[Key](), []
    for k in range(18):
        decoder.push(encoder.encode(motion, k).l0, None, k)
        if k > 0:
            done.append(decoder.render(k - 1))
            keys += merger.add(done[-1])
    keys += merger.flush()
    begins = [f.part.begin for f in done if isinstance(f.part, Window) and f.part.numbers]
    assert max(begins) > 2 * TICKS
    assert [str(key) for key in keys] == [str(key) for key in score.keys]
    assert [str(key) for frame in done for key in frame.keys] == [str(key) for key in score.keys]


@pytest.mark.parametrize("pace", [0.75, 0.9, 1.0, 1.3, 1.8])
def test_seven_bytes_keep_uneven_speech_in_time(pace: float) -> None:
    """Lengths by rule are corrected before a key starts a tenth of a second early or late."""
    rng = np.random.default_rng([round(100 * pace), 1])
    phones, time_s = list[Phone](), 1.0
    for phone in spoken(8 * SENTENCE).phones:
        length_s = pace * (phone.end - phone.start) * float(np.exp(0.4 * rng.normal()))
        phones.append(Phone(phone.symbol, time_s, time_s + length_s))
        time_s += length_s + 0.6 * (rng.random() < 0.05)
    score = Score(tuple(phones), tuple(cue(phones)))
    got = score_of(windows_of(score, 7))
    assert names(got) == names(score)
    late = [abs(a.start - b.start) for a, b in zip(score.keys, got.keys, strict=True)]
    assert max(late) < 0.101


def test_steering_agrees_with_its_python_and_stays_near() -> None:
    rng = np.random.default_rng(4)
    n = 40
    usual, true = rng.integers(2, 9, n), rng.integers(1, 12, n)
    kinds = rng.choice([0, 1, 2], n, p=[0.1, 0.4, 0.5])
    values, costs = np.array(CORRECTIONS), np.arange(1.0, 9.0)
    weights, limits = np.full(n, 0.2), np.full(n, 1.0)
    chosen, plain = np.zeros(n, np.int64), np.zeros(n, np.int64)
    total = _steering.steer(usual, true, kinds, weights, limits, 2, values, costs, chosen)
    again = _steering.steer.py_func(usual, true, kinds, weights, limits, 2, values, costs, plain)
    assert total == again
    np.testing.assert_array_equal(chosen, plain)
    # Its cost is that of its choice, and less than that of no correction and of the nearest one.
    assert total == pytest.approx(_cost(usual, true, kinds, chosen, values, costs))
    for other in (np.zeros(n, np.int64), rng.integers(0, 8, n)):
        assert total < _cost(usual, true, kinds, other, values, costs)


def _cost(
    usual: Ints, true: Ints, kinds: Ints, chosen: Ints, values: Ints, costs: NDArray[np.float64]
) -> float:
    total, late = 0.0, 2
    for k, kind in enumerate(kinds):
        length = usual[k] + (values[chosen[k]] if kind == 2 else 0)
        late = 0 if kind == 0 else late + min(max(length, 1), 32) - true[k]
        total += costs[chosen[k]] if kind == 2 else 0.0
        total += 0.2 * late**2 + max(abs(late) - _steering.STEADY, 0)
        late = min(max(late, -16), 16)
    return total
