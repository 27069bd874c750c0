"""Timing: phones on the grid, inside their subtitle, at a rate within the limits."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codec.errors import CueError
from synth.language.subtitles import Subtitle
from synth.language.text.pronounce import phonemise
from synth.planning.prosody.timing import FASTEST, GRID_HZ, HARDEST, SLOWEST, fit
from synth.planning.scoring.text_score import score_of_subtitles, score_of_text, stream_score

SENTENCE = "Ce beau matin d'été si doux, au détour d'un sentier, une charogne infâme."


@given(st.floats(0, 5000), st.floats(0.1, 30), st.floats(0, 5))
def test_fit(start_s: float, length_s: float, gap_s: float) -> None:
    words = phonemise(SENTENCE)
    start_s = round(start_s * GRID_HZ) / GRID_HZ
    found = fit(words, start_s, start_s + length_s, start_s + length_s + gap_s)
    for before, after in itertools.pairwise(found.phones):
        assert after.start >= before.end
    for phone in found.phones:
        assert phone.end - phone.start >= 1 / GRID_HZ - 1e-9
        assert abs(phone.start * GRID_HZ - round(phone.start * GRID_HZ)) < 1e-6
    if not found.left_out:
        assert SLOWEST - 1e-6 <= found.rate <= HARDEST + 1e-6
    if found.phones:
        assert found.phones[0].start == start_s
        assert found.phones[-1].end <= start_s + length_s + gap_s + 0.2


@pytest.mark.parametrize(
    ("length_s", "rate"), [(30.0, SLOWEST), (5.2, None), (3.6, FASTEST), (3.0, None)]
)
def test_rate_follows_the_room(length_s: float, rate: float | None) -> None:
    found = fit(phonemise(SENTENCE), 0.0, length_s, length_s)
    if rate is None:
        assert SLOWEST < found.rate < HARDEST
        assert found.rate != FASTEST
    else:
        assert found.rate == pytest.approx(rate)


def test_gap_is_borrowed_before_compressing() -> None:
    words = phonemise(SENTENCE)
    borrowed = fit(words, 0.0, 3.0, 9.0)
    assert borrowed.rate <= FASTEST + 1e-9
    assert borrowed.phones[-1].end == pytest.approx(3.0 + borrowed.borrowed_s)
    assert borrowed.borrowed_s > 0
    assert fit(words, 0.0, 3.0, 3.0).rate > FASTEST


def test_words_without_room_are_left_out_and_reported() -> None:
    notes: list[str] = []
    lines = [Subtitle(0.0, 0.5, SENTENCE, 2), Subtitle(0.5, 2.0, "Oui.", 6)]
    score = score_of_subtitles(lines, warn=notes.append)
    assert len(notes) == 2
    assert notes[0].startswith("subtitle at 0.00 s (line 2): no room for its last")
    assert score.phones[-1].symbol == "i"


def test_empty_interval() -> None:
    with pytest.raises(CueError, match=r"interval from 2.0 to 1.0 s is empty"):
        fit([], 2.0, 1.0, 1.0)


def test_overlapping_subtitles_are_spoken_in_turn() -> None:
    lines = [Subtitle(0.0, 3.0, SENTENCE), Subtitle(1.0, 4.0, "Oui, bien."), Subtitle(1.0, 4.0, "")]
    score = score_of_subtitles(lines, warn=lambda _: None)
    for before, after in itertools.pairwise(score.phones):
        assert after.start >= before.end


def test_pieces_of_a_stream_are_the_whole_score() -> None:
    lines = [Subtitle(2.0 * i, 2.0 * i + 1.9, "Rappelez-vous, mon âme !") for i in range(5)]
    pieces = list(stream_score(lines))
    whole = score_of_subtitles(lines)
    assert tuple(p for piece in pieces for p in piece.phones) == whole.phones
    assert tuple(k for piece in pieces for k in piece.keys) == whole.keys


def test_text_starts_where_asked() -> None:
    assert score_of_text("Oui.", start_s=1.009).phones[0].start == 1.0
    assert score_of_text("").phones == ()


def test_endless_subtitles_are_streamed() -> None:
    endless = (Subtitle(2.0 * i, 2.0 * i + 1.5, "Oui, non.") for i in itertools.count())
    pieces = list(itertools.islice(stream_score(endless), 400))
    assert pieces[-1].phones[0].start > 300
