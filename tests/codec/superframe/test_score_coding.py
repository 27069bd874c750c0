import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.phonology import CONSONANTS, PHONES, VOWELS
from codec.cues.score import PLACEMENTS, Key, Phone, Score
from codec.cues.timeline import TICK_S, TICKS, to_line, to_ticks
from codec.superframe.merging import score_of
from codec.superframe.range_coder import RangeDecoder, RangeEncoder
from codec.superframe.score_coding import (
    REST_GAPS_S,
    ScorePart,
    evenly,
    part_of,
    read_score,
    write_score,
)
from codec.superframe.tables import score_tables
from lab.format_tables import N, _after_two


@st.composite
def scores(draw: st.DrawFn) -> Score:
    """Phones on the grid, with and without gaps, some across several superframes."""
    n = draw(st.integers(1, 25))
    tick, phones = draw(st.integers(0, 50)), []
    for _ in range(n):
        tick += draw(st.sampled_from([0, 0, 0, 0, 1, 3, 30, 90]))
        end = tick + draw(st.one_of(st.integers(1, 8), st.integers(1, 80)))
        symbol = draw(st.sampled_from(PHONES[1:]))
        phones.append(Phone(symbol, tick * TICK_S, end * TICK_S))
        tick = end
    return Score(tuple(phones), tuple(cue(phones)))


def sent_parts(score: Score, options: CueingOptions = DEFAULT_OPTIONS) -> dict[int, ScorePart]:
    line = to_line(score, options)
    last = line.starts[-1] // TICKS
    return {k: part_of(line, k, options) for k in range(-1, last + 2)}


def on_ticks(score: Score) -> tuple[list[tuple[object, ...]], list[tuple[object, ...]]]:
    phones = [(p.symbol, to_ticks(p.start), to_ticks(p.end)) for p in score.phones]
    keys = [(k.shape, k.placement, to_ticks(k.start), to_ticks(k.end)) for k in score.keys]
    return phones, keys  # type: ignore[return-value]


@given(scores())
def test_parts_round_trip_and_join_to_the_sent_score(score: Score) -> None:
    parts = sent_parts(score)
    for part in parts.values():
        encoder = RangeEncoder()
        write_score(encoder, part, score_tables())
        assert read_score(RangeDecoder(encoder.finish()), score_tables()) == part
    assert on_ticks(score_of(parts)) == on_ticks(score)


@given(scores())
def test_a_superframe_alone_gives_the_right_keys_that_start_in_it(score: Score) -> None:
    for index, part in sent_parts(score).items():
        begin, end = index * TICKS, (index + 1) * TICKS
        alone = [
            (to_ticks(k.start), k.shape, k.placement)
            for k in score_of({index: part}).keys
            if begin <= to_ticks(k.start) < end
        ]
        sent = [
            (to_ticks(k.start), k.shape, k.placement)
            for k in score.keys
            if begin <= to_ticks(k.start) < end
        ]
        assert alone == sent


@given(scores(), st.sets(st.integers(0, 60)))
def test_no_key_is_wrong_because_of_a_loss(score: Score, lost: set[int]) -> None:
    parts = {k: part for k, part in sent_parts(score).items() if k not in lost}
    sent = [(k.phones, k.shape, k.placement) for k in score.keys]
    place = 0
    for key in score_of(parts).keys:
        # Every received key is one of the sent ones, in their order.
        place = sent.index((key.phones, key.shape, key.placement), place) + 1


@given(scores())
def test_even_parts_keep_phones_and_keys(score: Score) -> None:
    for index, part in sent_parts(score).items():
        if part.numbers:
            even = evenly(part)
            encoder = RangeEncoder()
            write_score(encoder, even, score_tables(), even=True)
            assert read_score(RangeDecoder(encoder.finish()), score_tables()) == even
            assert even.numbers == part.numbers
            keys = [score_of({index: p}).keys for p in (part, even)]
            assert [str(k) for k in keys[0]] == [str(k) for k in keys[1]]


def test_times_off_the_grid_keep_the_keys() -> None:
    """A gap of 7 ms separates two phones, one of 4 ms does not: both survive the grid."""
    for gap, expected in ((0.007, ["b", "a"]), (0.004, ["ba"])):
        phones = [Phone("b", 0.1, 0.2), Phone("a", 0.2 + gap, 0.3)]
        found = score_of(sent_parts(Score(tuple(phones), ()))).keys
        assert ["".join(key.phones) for key in found] == expected


def test_phones_shorter_than_a_tick_survive() -> None:
    rng = np.random.default_rng(5)
    symbols = rng.choice([*VOWELS, *CONSONANTS], size=60)
    ends = 0.3 + np.cumsum(rng.uniform(0.004, 0.03, size=60))
    phones = [
        Phone(str(s), float(b), float(e))
        for s, b, e in zip(symbols, [0.3, *ends[:-1]], ends, strict=True)
    ]
    score = Score(tuple(phones), tuple(cue(phones)))
    received = score_of(sent_parts(score))
    assert [str(k) for k in received.keys] == [str(k) for k in score.keys]


@pytest.mark.parametrize("gap", REST_GAPS_S)
def test_options_travel(gap: float) -> None:
    options = CueingOptions(un="cheek", schwa="cheek", oe="cheek", rest_gap_s=gap)
    phones = [Phone(s, 0.1 * i, 0.1 * i + 0.1) for i, s in enumerate(["l", "œ̃", "d", "ə", "œ"])]
    score = Score(tuple(phones), tuple(cue(phones, options)))
    parts = sent_parts(score, options)
    received = score_of(parts)
    assert [k.placement for k in received.keys] == ["cheek", "cheek", "cheek"]
    assert parts[0].options == options


def test_a_key_against_the_rule_travels_as_an_override() -> None:
    phones = [Phone(s, 0.1 * i, 0.1 * i + 0.1) for i, s in enumerate(["b", "a", "l", "i"])]
    ruled = list(cue(phones))
    other = Key(ruled[1].start, ruled[1].end, ruled[1].phones, 3, "throat")
    received = score_of(sent_parts(Score(tuple(phones), (ruled[0], other))))
    assert [(k.shape, k.placement) for k in received.keys] == [(4, "side"), (3, "throat")]


def test_keys_against_the_rule_are_not_wrong_where_reception_begins() -> None:
    """A key that began before may have been one of them: it is not told by rule."""
    phones = [Phone("ɔ̃" if k % 2 else "b", 0.12 * k, 0.12 * k + 0.12) for k in range(40)]
    others = [Key(k.start, k.end, k.phones, 3, "throat") for k in cue(phones)]
    parts = sent_parts(Score(tuple(phones), tuple(others)))
    for begin in range(1, 6):
        keys = score_of({k: part for k, part in parts.items() if k >= begin}).keys
        assert len(keys) > 5
        assert {(key.shape, key.placement) for key in keys} == {(3, "throat")}


def test_a_score_of_keys_alone_travels() -> None:
    keys = (Key(0.2, 0.5, ("b", "a"), 4, "side"), Key(0.5, 0.7, ("s",), 3, "side"))
    received = score_of(sent_parts(Score((), keys)))
    assert [(k.phones, k.shape) for k in received.keys] == [(("b", "a"), 4), (("s",), 3)]


def test_silence_costs_little() -> None:
    encoder = RangeEncoder()
    write_score(encoder, part_of(to_line(None), 7), score_tables())
    assert encoder.bits < 8


def test_tables_are_of_the_stated_shapes() -> None:
    tables = score_tables()
    assert tables.first.shape == (39,)
    assert tables.next.shape == (39, 38, 39)
    assert tables.left.shape == (38, 34)
    assert tables.length.shape == (38, 4, 34)
    assert len(PLACEMENTS) == 6


def test_what_follows_two_phones_counts_the_more_the_fewer_kinds_were_found() -> None:
    """Fifty examples of one kind outweigh what is usual; few of many kinds do not."""
    counts = np.ones((N, N, N))
    counts[1, 2] = 0
    counts[1, 2, 5] = 50
    counts[3, 4] = 0
    counts[3, 4, :25] = 1
    rows = _after_two(counts)
    assert rows.shape == (N + 1, N, N)
    np.testing.assert_allclose(rows.sum(axis=-1), 1.0)
    assert rows[1, 2, 5] > 0.9
    assert rows[3, 4, :25].max() < 0.04
    assert rows[3, 4].min() > 0.01
