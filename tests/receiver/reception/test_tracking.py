"""The timeline of superframes: places, duplicates, losses, splices, keys."""

import functools
import itertools
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.score import Phone
from codec.cues.timeline import SUPERFRAME_S
from codec.superframe.bits import crc16
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.superframe import Superframe
from receiver.reception.assemble import Assembler
from receiver.reception.events import (
    Event,
    KeysFound,
    MotionPiece,
    StateChanged,
    SuperframeLost,
    Unreadable,
)
from receiver.reception.tracking import LOST_AFTER_S, TimelineTracker
from tests.receiver.standin import make_motion, make_voice

VOICE = make_voice()
MOTION = make_motion(VOICE, duration_s=16.0)
LEAD_S = 1.28
OFFSET_S = 0.137  # the stream's clock is not the programme's


def encoded(first: int, end: int) -> list[tuple[float, Superframe]]:
    """Superframes with the times at which they are on air, lead 2."""
    encoder = SuperframeEncoder(VOICE, l0_bytes=40, l1_bytes=40)
    return [
        (OFFSET_S + 0.64 * index - LEAD_S, encoder.encode(MOTION, index))
        for index in range(first, end)
    ]


@functools.cache
def programme() -> list[tuple[float, Superframe]]:
    """All superframes of the programme, coded when a test first asks: importing costs nothing."""
    return encoded(2, 22)


def run(tracker: TimelineTracker, sent: Iterable[tuple[float, Superframe | None]]) -> list[Event]:
    return list(_run(tracker, sent))


def _run(
    tracker: TimelineTracker, sent: Iterable[tuple[float, Superframe | None]]
) -> Iterator[Event]:
    for on_air_s, superframe in sent:
        if superframe is None:
            yield from tracker.take(None, None, on_air_s)
        else:
            yield from tracker.take(superframe.l0, superframe.l1, on_air_s)
    yield from tracker.finish()


def pieces(events: Iterable[Event]) -> dict[float, MotionPiece]:
    return {round(e.start_s, 3): e for e in events if isinstance(e, MotionPiece)}


def keys(events: Iterable[Event]) -> list[tuple[float, int, str]]:
    final = [e.keys for e in events if isinstance(e, KeysFound) and e.final]
    return [(round(k.start, 2), k.shape, k.placement) for k in itertools.chain(*final)]


@functools.cache
def everything() -> list[Event]:
    """All events of the programme."""
    return run(TimelineTracker(VOICE), programme())


def test_motion_lies_where_it_is_due() -> None:
    found = pieces(everything())
    assert list(found) == [round(OFFSET_S + 0.64 * i, 3) for i in range(2, 22)]
    assert all(p.params.shape == (32, len(VOICE.layout)) for p in found.values())
    assert all(p.layers == ("L0", "L1") for p in found.values())


def test_keys_are_told_before_they_are_settled() -> None:
    told = [e for e in everything() if isinstance(e, KeysFound)]
    assert all(e.keys for e in told)
    early = {(round(k.start, 2), k.shape) for e in told if not e.final for k in e.keys}
    assert {(start, shape) for start, shape, _ in keys(everything())[1:-1]} <= early


def test_every_key_comes_once() -> None:
    assert MOTION.score is not None
    # The first key began before the first superframe: only the rule gives it, not its time.
    found = keys(everything())[1:]
    sent = [
        (k.start + OFFSET_S, k.shape, k.placement)
        for k in MOTION.score.keys
        if found[0][0] - 0.02 < k.start + OFFSET_S < found[-1][0] + 0.02
    ]
    assert [key[1:] for key in found] == [key[1:] for key in sent]
    assert np.allclose([key[0] for key in found], [key[0] for key in sent], atol=0.011)
    assert len(found) >= 40


def test_a_loss_is_told_and_concealed() -> None:
    tracker = TimelineTracker(VOICE)
    events = run(tracker, [(t, None if i == 7 else s) for i, (t, s) in enumerate(programme())])
    lost = [e.start_s for e in events if isinstance(e, SuperframeLost)]
    assert lost == [pytest.approx(OFFSET_S + 0.64 * 9)]
    found = pieces(events)
    assert found[round(lost[0], 3)].layers == ()
    assert (tracker.received, tracker.lost) == (19, 1)
    states = [e.state for e in events if isinstance(e, StateChanged)]
    assert states == ["locked", "degraded", "locked"]


def test_a_gap_without_word_counts_the_same() -> None:
    silent = [pair for i, pair in enumerate(programme()) if i not in (5, 6)]
    told = [(t, None if i in (5, 6) else s) for i, (t, s) in enumerate(programme())]
    first, second = TimelineTracker(VOICE), TimelineTracker(VOICE)
    a, b = run(first, silent), run(second, told)
    assert (first.received, first.lost) == (second.received, second.lost) == (18, 2)
    assert sorted(pieces(a)) == sorted(pieces(b))
    assert keys(a) == keys(b)


def test_duplicates_and_late_superframes_change_nothing() -> None:
    tracker = TimelineTracker(VOICE)
    twice = [pair for pair in programme() for _ in range(2)]
    events = run(tracker, twice)
    assert (tracker.received, tracker.lost) == (20, 0)
    assert keys(events) == keys(everything())
    late = TimelineTracker(VOICE)
    order = [*programme()[:4], programme()[5], programme()[4], *programme()[6:]]
    swapped = pieces(run(late, order))
    assert (late.received, late.lost) == (20, 0)
    for start_s, piece in pieces(everything()).items():
        assert np.array_equal(swapped[start_s].params, piece.params)


def test_a_better_copy_replaces_a_worse_one() -> None:
    tracker = TimelineTracker(VOICE)
    t, s = programme()[3]
    poor = Superframe(s.index, s.l0, bytes(len(s.l1)))
    events = run(tracker, [*programme()[:3], (t, poor), (t, s), *programme()[4:]])
    assert (tracker.received, tracker.received_l1) == (20, 20)
    assert np.array_equal(
        pieces(events)[round(OFFSET_S + 0.64 * 5, 3)].params,
        pieces(everything())[round(OFFSET_S + 0.64 * 5, 3)].params,
    )


def test_a_splice_starts_a_new_epoch() -> None:
    jumped = [(t + 100.29, s) for t, s in programme()[8:]]
    events = run(TimelineTracker(VOICE), [*programme()[:8], *jumped])
    found = pieces(events)
    assert {p.epoch for p in found.values()} == {0, 1}
    start = round(OFFSET_S + 0.64 * 11 + 100.29, 3)  # the first one lacks a neighbour
    assert np.array_equal(
        found[start].params, pieces(everything())[round(OFFSET_S + 7.04, 3)].params
    )
    assert sum(isinstance(e, SuperframeLost) for e in events) == 0
    states = [(e.state, e.time_s) for e in events if isinstance(e, StateChanged)]
    assert [state for state, _ in states] == ["locked", "lost", "locked"]


def test_silence_means_lost() -> None:
    tracker = TimelineTracker(VOICE)
    run(tracker, programme()[:5])
    last_s = programme()[4][0]
    # Superframes may all come half a superframe late; the sixth that is missing is the last straw.
    assert 5 * SUPERFRAME_S < LOST_AFTER_S < 6 * SUPERFRAME_S
    assert list(tracker.advance(last_s + LOST_AFTER_S - 0.01)) == []
    events = list(tracker.advance(last_s + LOST_AFTER_S + 7))
    assert events == [StateChanged(last_s + LOST_AFTER_S, "lost")]
    assert list(tracker.advance(last_s + 99)) == []


def test_another_voice_is_told_and_not_drawn() -> None:
    other = TimelineTracker(make_voice(1))
    events = run(other, programme())
    foreign = [e for e in events if isinstance(e, Unreadable)]
    assert len(foreign) == 1
    assert "the identity of voice stand-in" in foreign[0].message
    assert len(pieces(events)) <= 2  # one digit of sixteen may agree by chance


def test_assembled_motion_is_whole() -> None:
    assembler = Assembler(VOICE)
    for event in run(
        TimelineTracker(VOICE), [p for i, p in enumerate(programme()) if not 9 <= i < 13]
    ):
        assembler.add(event)
    motion = assembler.motion()
    assert motion.start_s == pytest.approx(OFFSET_S + 1.28)
    assert len(motion.params) == 20 * 32
    whole = pieces(everything())[round(OFFSET_S + 1.28, 3)].params
    assert np.allclose(motion.params[:32], whole)
    assert motion.score is not None
    assert [round(k.start, 2) for k in motion.score.keys] == sorted(
        {round(k.start, 2) for k in motion.score.keys}
    )


def foreign(version: int | None = None, offset_s: float = 0.0) -> list[tuple[float, Superframe]]:
    """Superframes 10 and 11 of another voice, or of another version, in the places of ours."""
    encoder = SuperframeEncoder(make_voice(1), l0_bytes=40, l1_bytes=40)
    motion = make_motion(make_voice(1), duration_s=16.0)
    found = []
    for index in (10, 11):
        superframe = encoder.encode(motion, index)
        if version is not None:
            l0 = bytes([superframe.l0[0] & 0x3F | version << 6, *superframe.l0[1:-2]])
            superframe = replace(superframe, l0=l0 + crc16(l0).to_bytes(2, "big"))
        found.append((OFFSET_S + 0.64 * index - LEAD_S + offset_s, superframe))
    return found


@pytest.mark.parametrize("version", [None, 0, 1, 2])
@pytest.mark.parametrize("offset_s", [0.0, 0.21])
def test_a_foreign_stretch_ends_with_the_next_genuine_superframe(
    version: int | None, offset_s: float
) -> None:
    tracker = TimelineTracker(VOICE)
    sent = [*programme()[:8], *foreign(version, offset_s), *programme()[10:]]
    events = run(tracker, sent)
    assert (tracker.received, tracker.lost) == (18, 2)
    assert sum(isinstance(e, Unreadable) for e in events) == 1
    assert set(keys(events)) <= set(keys(everything()))
    assert tracker.state == "locked"


def test_a_foreign_stream_is_not_believed_for_a_digit_that_agrees() -> None:
    """One digit of sixteen does: on its grid it takes two in a row, and nothing gets lost."""
    ours = [(t, s.index) for t, s in programme()]
    drawn = 0
    for seed in range(2, 8):
        voice = make_voice(seed)
        encoder = SuperframeEncoder(voice, l0_bytes=40, l1_bytes=40)
        motion = make_motion(voice, duration_s=16.0)
        sent = [(t, encoder.encode(motion, index)) for t, index in ours]
        drawn += sum(p.layers != () for p in pieces(run(TimelineTracker(VOICE), sent)).values())
    assert drawn <= 6


def test_a_pause_of_hours_is_no_loss() -> None:
    """Even where it happens to end on the old grid and number."""
    tracker = TimelineTracker(VOICE)
    pause_s = 64 * 400 * 0.64
    events = run(tracker, [*programme()[:8], *((t + pause_s, s) for t, s in programme()[8:])])
    assert (tracker.received, tracker.lost) == (20, 0)
    assert len(events) < 120


@pytest.mark.parametrize("told", [False, True])
def test_a_long_gap_is_told_in_bulk(told: bool) -> None:
    gap = range(20, 20 + 44)
    later = [(t + 64 * 0.64, s) for t, s in programme()]
    between = [(programme()[-1][0] + 0.64 * (k + 1), None) for k in range(len(gap))] if told else []
    tracker = TimelineTracker(VOICE)
    list(_run(tracker, programme()))
    events = run(tracker, [*between, later[0]])
    lost = [e for e in events if isinstance(e, SuperframeLost)]
    assert sum(e.count for e in lost) == tracker.lost == 44
    if not told:
        assert len(events) <= 64
        assert [e.count for e in lost] == [1] * 6 + [36] + [1] * 2
        starts = [(e.start_s - OFFSET_S) / 0.64 for e in lost]
        assert starts == pytest.approx([22, 23, 24, 25, 26, 27, 28, 64, 65])


@pytest.mark.parametrize("gap", range(1, 12))
def test_up_to_eight_lost_superframes_are_drawn(gap: int) -> None:
    events = run(TimelineTracker(VOICE), [*programme()[:5], *programme()[5 + gap :]])
    assert sum(e.count for e in events if isinstance(e, SuperframeLost)) == gap
    drawn = {start for start, piece in pieces(events).items() if not piece.layers}
    assert len(drawn) == min(gap, 8)


def test_a_failure_after_reception_was_lost_changes_nothing() -> None:
    tracker = TimelineTracker(VOICE)
    run(tracker, programme()[:5])
    list(tracker.advance(programme()[4][0] + LOST_AFTER_S))
    later = list(tracker.take(None, None, programme()[4][0] + 0.64 * 8))
    assert not any(isinstance(e, StateChanged) for e in later)
    assert tracker.state == "lost"


@pytest.mark.parametrize(("early", "epochs"), [(8, 1), (9, 2)])
def test_how_late_a_superframe_may_come(early: int, epochs: int) -> None:
    """The decoder remembers eight."""
    sent = [
        programme()[0],
        *programme()[11 - early + 1 :][: early - 1],
        programme()[11],
        programme()[11 - early],
    ]
    events = run(TimelineTracker(VOICE), sent)
    assert len({e.epoch for e in events if isinstance(e, MotionPiece)}) == epochs


@pytest.mark.parametrize(("later", "epochs"), [(64, 1), (65, 2)])
def test_how_long_a_pause_is_a_loss(later: int, epochs: int) -> None:
    """As long as the sequence number tells one from a splice."""
    again = (programme()[3][0] + 64 * 0.64 + 0.64 * (later - 64), programme()[3 + later - 64][1])
    events = run(TimelineTracker(VOICE), [*programme()[:4], again])
    assert len({e.epoch for e in events if isinstance(e, MotionPiece)}) == epochs


def test_what_is_remembered_does_not_grow() -> None:
    tracker = TimelineTracker(VOICE)
    for number in range(300):
        superframe = programme()[number % 16][1]
        list(
            tracker.take(
                superframe.l0, superframe.l1, number // 16 * 64 * 0.64 + programme()[number % 16][0]
            )
        )
    assert len(tracker._layers) <= 66
    assert len(tracker._richness) <= 66
    assert tracker._epoch == 0


def test_what_failed_is_told_at_once() -> None:
    tracker = TimelineTracker(VOICE)
    for on_air_s, sent in programme()[:5]:
        list(tracker.take(sent.l0, sent.l1, on_air_s))
    for k in (5, 6):
        on_air_s = programme()[k][0]
        events = list(tracker.take(None, None, on_air_s))
        assert [e.start_s for e in events if isinstance(e, SuperframeLost)] == [
            pytest.approx(on_air_s + LEAD_S)
        ]
        assert [p.layers for p in events if isinstance(p, MotionPiece)] == [()]
        states = [e for e in events if isinstance(e, StateChanged)]
        assert states == ([StateChanged(on_air_s + 0.64, "degraded")] if k == 5 else [])
    assert tracker.lost == 2


def test_a_failure_long_after_the_last_superframe_is_nothing() -> None:
    tracker = TimelineTracker(VOICE)
    run(tracker, programme()[:5])
    lost_before = tracker.lost
    events = list(tracker.take(None, None, programme()[4][0] + 65 * 0.64))
    assert not any(isinstance(e, SuperframeLost) for e in events)
    assert tracker.lost == lost_before
    events = list(tracker.take(None, None, programme()[4][0] + 64 * 0.64))
    assert sum(e.count for e in events if isinstance(e, SuperframeLost)) == 64


def test_the_same_again_is_nothing_and_more_of_it_is_drawn() -> None:
    tracker = TimelineTracker(VOICE)
    (t, s), rest = programme()[3], programme()[:3]
    for on_air_s, sent in rest:
        list(tracker.take(sent.l0, sent.l1, on_air_s))
    assert list(tracker.take(s.l0, None, t))
    assert list(tracker.take(s.l0, None, t)) == []
    longer = list(tracker.take(s.l0, s.l1, t))
    assert any(isinstance(e, MotionPiece) and e.layers == ("L0", "L1") for e in longer)
    for l1 in (s.l1, None, b""):
        assert list(tracker.take(s.l0, l1, t)) == []
    assert list(tracker.take(s.l0, s.l1 + bytes(len(s.l1)), t))


def test_the_state_changes_when_the_superframe_has_come() -> None:
    changes = [
        e for e in run(TimelineTracker(VOICE), programme()[:1]) if isinstance(e, StateChanged)
    ]
    assert [(e.time_s, e.state) for e in changes] == [(programme()[0][0] + 0.64, "locked")]


def test_a_late_superframe_makes_its_neighbours_better() -> None:
    tracker = TimelineTracker(VOICE)
    for number in (0, 1, 3, 4):
        list(
            tracker.take(
                programme()[number][1].l0, programme()[number][1].l1, programme()[number][0]
            )
        )
    late = list(tracker.take(programme()[2][1].l0, programme()[2][1].l1, programme()[2][0]))
    assert list(pieces(late)) == [pytest.approx(OFFSET_S + 0.64 * k, abs=0.001) for k in (3, 5, 4)]
    assert tracker.lost == 0


def test_where_others_were_one_superframe_is_proof_enough() -> None:
    tracker = TimelineTracker(VOICE)
    run(tracker, [*programme()[:8], *foreign()])
    (t, s), drawn = programme()[10], []
    drawn = [e for e in tracker.take(s.l0, s.l1, t) if isinstance(e, MotionPiece) and e.layers]
    assert drawn


def test_where_others_were_it_takes_four_compact_ones() -> None:
    """Each tells two bits of the identity; then all four are drawn."""
    tracker = TimelineTracker(VOICE)
    drawn = []
    for number, (on_air_s, l0) in enumerate(compact_superframes(VOICE)):
        given = bytes([*l0[:-1], l0[-1] ^ 1]) if number in (6, 7) else l0
        drawn.append(drawn_of(tracker, on_air_s, given))
    assert drawn[6:11] == [0] * 5
    assert drawn[11] >= 4
    assert (tracker.received, tracker.lost) == (14, 2)


def test_a_compact_stream_that_leaves_the_grid_takes_four_superframes() -> None:
    """One in four of another voice's agrees by chance, whichever comes first."""
    ours = compact_superframes(VOICE)
    away = [(t + 0.3, l0) for t, l0 in ours[6:]]
    tracker = TimelineTracker(VOICE)
    drawn = [drawn_of(tracker, t, l0) for t, l0 in [*ours[:6], *away]]
    assert drawn[6:9] == [0, 0, 0]
    assert drawn[9] >= 4
    for seed in range(1, 4):
        theirs = compact_superframes(make_voice(seed))
        for first in range(10):
            tracker = TimelineTracker(VOICE)
            for t, l0 in ours[:2]:
                drawn_of(tracker, t, l0)
            start_s = ours[2][0] + 0.3 - theirs[first][0]
            shown = [drawn_of(tracker, start_s + t, l0) for t, l0 in theirs[first:]]
            assert not any(shown)


def compact_superframes(voice: Voice) -> list[tuple[float, bytes]]:
    """Sixteen compact superframes of a voice, with the times at which they are on air."""
    encoder = CompactEncoder(voice, l0_bytes=12, first=2)
    motion = with_phones(make_motion(voice, duration_s=16.0))
    return [(OFFSET_S + 0.64 * k - LEAD_S, encoder.encode(motion, k).l0) for k in range(2, 18)]


def drawn_of(tracker: TimelineTracker, on_air_s: float, l0: bytes) -> int:
    """Superframes drawn of what arrived, once this one has."""
    found = pieces(list(tracker.take(l0, None, on_air_s)))
    return sum(1 for piece in found.values() if piece.layers)


@pytest.mark.parametrize(("offset_s", "epochs"), [(0.09, 1), (0.11, 2), (-0.09, 1), (-0.11, 2)])
def test_a_splice_is_told_from_a_drift(offset_s: float, epochs: int) -> None:
    moved = [(t + offset_s, s) for t, s in programme()[8:]]
    found = pieces(run(TimelineTracker(VOICE), [*programme()[:8], *moved]))
    assert len({p.epoch for p in found.values()}) == epochs


def test_keys_reach_back_over_five_superframes() -> None:
    """A window four superframes before one still tells keys of it."""
    score = MOTION.score
    assert score is not None
    slow = replace(
        MOTION,
        score=type(score)(
            (), tuple(replace(k, start=2 * k.start, end=2 * k.end) for k in score.keys)
        ),
    )
    encoder = CompactEncoder(VOICE, l0_bytes=12, first=2)
    sent = [
        (OFFSET_S + 0.64 * k - LEAD_S, encoder.encode(with_phones(slow), k)) for k in range(2, 22)
    ]
    found = keys(run(TimelineTracker(VOICE), sent))
    starts = [start for start, _, _ in found]
    assert len(starts) == len(set(starts)) > 12
    gaps = np.diff(starts)
    assert gaps.max() < 1.5


def with_phones(motion: Motion) -> Motion:
    """Keys of two phones each, as the compact encoder needs them."""
    assert motion.score is not None
    phones = []
    for key in motion.score.keys:
        middle = (key.start + key.end) / 2
        phones += [Phone("b", key.start, middle), Phone("ɔ̃", middle, key.end)]
    return replace(motion, score=replace(motion.score, phones=tuple(phones)))


def test_without_motion_all_else_is_the_same() -> None:
    sent = [(at_s, None if n in (5, 6) else one) for n, (at_s, one) in enumerate(programme())]
    drawn, bare = (run(TimelineTracker(VOICE, draw=draw), sent) for draw in (True, False))
    assert not pieces(bare)
    assert repr(bare) == repr([e for e in drawn if not isinstance(e, MotionPiece)])
