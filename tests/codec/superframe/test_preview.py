import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.phonology import PHONES
from codec.cues.score import Phone, Score
from codec.cues.timeline import TICK_S, TICKS, to_line
from codec.superframe.merging import score_of
from codec.superframe.preview import (
    AHEAD,
    CHOICES,
    EXACT,
    SILENCE,
    Preview,
    part_of_preview,
    preview_of,
    read_previews,
    thinned,
    write_previews,
)
from codec.superframe.range_coder import RangeDecoder, RangeEncoder
from codec.superframe.score_coding import part_of
from codec.superframe.tables import score_tables


@st.composite
def lines(draw: st.DrawFn) -> Score:
    tick, phones = draw(st.integers(0, 50)), []
    for _ in range(draw(st.integers(1, 40))):
        tick += draw(st.sampled_from([0, 0, 0, 0, 6, 30, 90]))
        end = tick + draw(st.integers(4, 12))
        phones.append(Phone(draw(st.sampled_from(PHONES[1:])), tick * TICK_S, end * TICK_S))
        tick = end
    return Score(tuple(phones), ())


@given(lines(), st.sampled_from(CHOICES))
def test_previews_round_trip(score: Score, distances: tuple[int, ...]) -> None:
    line = to_line(score)
    for index in range(line.starts[-1] // TICKS + 1):
        sent = {d: preview_of(part_of(line, index + d), d) for d in distances}
        encoder = RangeEncoder()
        write_previews(encoder, sent, score_tables())
        assert read_previews(RangeDecoder(encoder.finish()), score_tables()) == sent


@given(st.binary(max_size=30))
def test_any_code_is_a_preview(code: bytes) -> None:
    for preview in read_previews(RangeDecoder(code), score_tables()).values():
        ticks = [tick for tick, _ in preview]
        assert ticks == sorted(set(ticks))
        assert all(0 <= tick < TICKS for tick in ticks)
        score_of({3: part_of_preview(preview)})


@settings(max_examples=60)
@given(lines(), st.integers(0, 20), st.sampled_from(AHEAD))
def test_a_previewed_superframe_keeps_every_key(score: Score, place: int, distance: int) -> None:
    line = to_line(score)
    parts = {k: part_of(line, k) for k in range(-1, line.starts[-1] // TICKS + 2)}
    lost = sorted(parts)[place % len(parts)]
    whole = score_of(parts)
    holed = score_of(parts | {lost: part_of_preview(preview_of(parts[lost], distance))})
    assert [str(key) for key in holed.keys] == [str(key) for key in whole.keys]
    for sent, got in zip(whole.keys, holed.keys, strict=True):
        exact = distance == EXACT or round(sent.start / TICK_S) // TICKS != lost
        assert abs(sent.start - got.start) < (0.001 if exact else 0.021)
        inside = round(got.start / TICK_S) // TICKS == lost
        assert got.phones == (() if inside else sent.phones)


@pytest.mark.parametrize(
    ("options", "symbol"), [(DEFAULT_OPTIONS, 5 * 5 + 0), (CueingOptions(schwa="cheek"), 5 * 5 + 3)]
)
def test_placements_are_those_of_the_options(options: CueingOptions, symbol: int) -> None:
    line = to_line(Score((Phone("l", 0.1, 0.2), Phone("ə", 0.2, 0.3)), ()), options)
    assert preview_of(part_of(line, 0, options)) == ((5, symbol), (15, SILENCE))


def test_a_thin_preview_keeps_the_last_start() -> None:
    preview = ((3, 7), (5, 8), (20, 40), (25, 9))
    thin: list[Preview] = [preview]
    while len(thin[-1]) > 1:
        thin.append(thinned(thin[-1]))
    assert [p[-1] for p in thin] == [(25, 9)] * 4
    assert thin[1] == ((5, 8), (20, 40), (25, 9))
    assert thinned(thin[-1]) == thin[-1]
