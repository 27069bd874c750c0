"""Labels: keys of filmed cuers in cells, alone and within whole superframes."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.score import Key, Score
from codec.cues.timeline import TICKS, to_line
from codec.superframe.coding import coding_for
from codec.superframe.decoder import BLEND, SuperframeDecoder, blended
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.filmed import is_filmed
from codec.superframe.labels import CELL, CHOICES, OWN, labels_of, read_labels, write_labels
from codec.superframe.merging import score_of
from codec.superframe.payload import read_beginning, read_l0
from codec.superframe.preview import SILENCE, Preview, part_of_preview
from codec.superframe.range_coder import RangeDecoder, RangeEncoder
from codec.superframe.score_coding import part_of
from codec.superframe.superframe import Superframe, merge_scores
from codec.superframe.tables import score_tables
from tests.codec.speech import SENTENCE, spoken

COUNT = 8
FAR_S = 0.041
"""Seconds by which half a cell makes a key early or late, at most, and what rounding adds."""


@st.composite
def lists(draw: st.DrawFn) -> Preview:
    cells = draw(st.sets(st.integers(0, TICKS // CELL - 1)))
    symbols = st.integers(0, SILENCE)
    return tuple((CELL * cell + CELL // 2, draw(symbols)) for cell in sorted(cells))


@given(st.sampled_from(CHOICES), st.data())
def test_labels_round_trip(others: tuple[int, ...], data: st.DataObject) -> None:
    sent = {distance: data.draw(lists()) for distance in (OWN, *others)}
    encoder = RangeEncoder()
    write_labels(encoder, sent, score_tables())
    assert read_labels(RangeDecoder(encoder.finish()), score_tables()) == sent


@given(st.binary(max_size=30))
def test_any_code_is_labels(code: bytes) -> None:
    for labels in read_labels(RangeDecoder(code), score_tables()).values():
        assert labels_of(labels) == labels
        score_of({3: part_of_preview(labels)})


def filmed(voice: Voice, perform: Callable[..., Motion]) -> tuple[Score, list[Superframe]]:
    """Return a score at the pace of real cuers, and its filmed superframes."""
    score = spoken(SENTENCE, length_s=0.16)
    motion = perform(score, COUNT)
    encoder = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=7, protected=True, filmed=True)
    return score, [encoder.encode(motion, k) for k in range(COUNT)]


def received(voice: Voice, frames: list[Superframe], lost: int = -1) -> list[Key]:
    decoder, done = SuperframeDecoder(voice), []
    for frame in frames:
        there = frame.index != lost
        decoder.take(frame.l0 if there else None, frame.l1 if there else None, frame.index)
    done = [decoder.render(frame.index) for frame in frames]
    return list(merge_scores(done).keys)


def alike(found: list[Key], score: Score) -> bool:
    sent = [key for key in score.keys if key.start < 0.64 * COUNT]
    pairs = zip(found, sent, strict=True)
    return len(found) == len(sent) and all(
        (a.shape, a.placement) == (b.shape, b.placement) and abs(a.start - b.start) < FAR_S
        for a, b in pairs
    )


def test_keys_of_filmed_superframes_arrive(
    toy_voice: Voice, perform: Callable[..., Motion]
) -> None:
    score, frames = filmed(toy_voice, perform)
    assert all((len(frame.l0), len(frame.l1)) == (20, 7) for frame in frames)
    assert all(read_beginning(frame.l0).header.filmed for frame in frames)
    assert alike(received(toy_voice, frames), score)


def test_no_single_loss_takes_a_key(toy_voice: Voice, perform: Callable[..., Motion]) -> None:
    score, frames = filmed(toy_voice, perform)
    for lost in range(COUNT):
        assert alike(received(toy_voice, frames, lost), score), lost


def test_labels_against_a_second_loss_stay_out_where_they_cost_much(
    toy_voice: Voice, perform: Callable[..., Motion], monkeypatch: pytest.MonkeyPatch
) -> None:
    room = "codec.superframe.filmed_encoder."
    monkeypatch.setattr(room + "_WORTH", 1e9)
    monkeypatch.setattr(room + "TURNS", 0)
    bases, lists = coding_for(toy_voice).bases, []
    for most in (0.0, 1e9):
        monkeypatch.setattr(room + "_MOST_COST", most)
        _, frames = filmed(toy_voice, perform)
        lists.append(sum(len(read_l0(frame.l0, bases)[0].previews) for frame in frames))
    assert lists[0] < lists[1]


def test_too_small_superframes_thin_their_labels(
    toy_voice: Voice, perform: Callable[..., Motion]
) -> None:
    motion = perform(spoken(SENTENCE), COUNT)
    for size in (8, 10, 13):
        encoder = SuperframeEncoder(toy_voice, l0_bytes=size, l1_bytes=0, filmed=True)
        frames = [encoder.encode(motion, k) for k in range(COUNT)]
        assert all(read_beginning(frame.l0).header.filmed for frame in frames)
        received(toy_voice, frames)


def test_lips_take_no_stand_in_for_a_phone(
    toy_voice: Voice, perform: Callable[..., Motion]
) -> None:
    _, frames = filmed(toy_voice, perform)
    bare, kept = SuperframeDecoder(toy_voice), SuperframeDecoder(toy_voice, lips=True)
    for frame in frames:
        bare.take(frame.l0, frame.l1, frame.index)
        kept.take(frame.l0, frame.l1, frame.index)
    for k in range(COUNT):
        np.testing.assert_array_equal(kept.render(k).params, bare.render(k).params)


def test_borders_are_blended() -> None:
    line = np.arange(3 * TICKS, dtype=float)[:, None] * np.array([1.0, -3.0])
    before, own, after = np.split(line, 3)
    np.testing.assert_allclose(blended(own, before, after), own, atol=1e-9)
    found = blended(own, before + 1.0, None)
    np.testing.assert_allclose((found - own)[:4], np.repeat(BLEND, 2, axis=1))
    np.testing.assert_array_equal(found[4:], own[4:])
    np.testing.assert_array_equal(blended(own, None, None), own)


@pytest.fixture(scope="module")
def by_rule() -> Motion:
    from synth.motion.rules.performance import motion_of
    from synth.planning.scoring.text_score import score_of_text

    score = score_of_text("Un bon vin blanc, puis du pain et du beurre.", start_s=0.7)
    return motion_of(score, load_voice())


def test_who_was_filmed(by_rule: Motion) -> None:
    voice = load_voice()
    assert not is_filmed(by_rule, voice)
    # Of another time, she does not follow her score.
    moved = np.roll(by_rule.params, 35, axis=0)
    other = Motion(
        moved, by_rule.rate_hz, by_rule.start_s, by_rule.layout, by_rule.voice, by_rule.score
    )
    assert is_filmed(other, voice)
    line = to_line(by_rule.score)
    for protected in (False, True):
        encoder = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=7, protected=protected)
        for motion in (by_rule, other):
            index = 2
            assert part_of(line, index).key_starts()
            header = read_beginning(encoder.encode(motion, index).l0).header
            assert header.filmed == (protected and motion is other)
