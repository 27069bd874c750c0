"""The cuer's own clock: bounds of lag and pace, omissions, independence of blocks."""

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from codec.cues.cueing import cue
from codec.cues.phonology import CONSONANTS, VOWELS
from codec.cues.score import Phone
from codec.errors import CueError
from synth.language.subtitles import Subtitle
from synth.language.text.words import Word
from synth.planning.prosody.importance import importance, links
from synth.planning.prosody.key_times import STILL_S, least_s
from synth.planning.prosody.pace_report import PaceReport
from synth.planning.prosody.pacing import LEAD_S, READABLE, Pace, PacedWord, TimedWord, pace_words
from synth.planning.prosody.taut_string import taut_string
from synth.planning.scoring.text_score import (
    Reading,
    score_of_subtitles,
    score_of_text,
    words_of_subtitles,
)

pytestmark = pytest.mark.long(7)

TEXT = "Le président de la République ne veut pas présenter les mesures aux syndicats ce matin."


def news(count: int, characters_per_s: float) -> list[Subtitle]:
    length_s = len(TEXT) / characters_per_s
    return [Subtitle(1 + i * length_s, 0.95 + (i + 1) * length_s, TEXT) for i in range(count)]


def paced(subtitles: list[Subtitle], pace: Pace = READABLE) -> tuple[list[PacedWord], PaceReport]:
    told: list[PacedWord] = []
    report = PaceReport()

    def tell(word: PacedWord) -> None:
        told.append(word)
        report(word)

    score_of_subtitles(subtitles, reading=Reading(pace=pace), on_word=tell)
    return told, report


SYMBOLS = st.lists(st.sampled_from([*VOWELS, *CONSONANTS]), min_size=1, max_size=6)


Speech = list[tuple[list[str], float, float, bool]]
WORDS = st.tuples(SYMBOLS, st.floats(0.02, 0.3), st.floats(0, 2), st.booleans())


@settings(max_examples=40)
@example([(["e", "a", "e", "a"], 1 / 32, 0.0, False)], 0.0)  # no word of a block has room
@given(st.lists(WORDS, min_size=1, max_size=8), st.floats(0, 2.5))
def test_bounds_hold_whatever_is_said(said: Speech, max_lag_s: float) -> None:
    within_bounds(said, max_lag_s)


@pytest.mark.slow
@settings(max_examples=200)
@given(st.lists(WORDS, min_size=8, max_size=25), st.floats(0, 2.5))
def test_bounds_hold_over_several_blocks(said: Speech, max_lag_s: float) -> None:
    within_bounds(said, max_lag_s)


def within_bounds(said: Speech, max_lag_s: float) -> None:
    words, clock = [], 2.0
    for symbols, length_s, gap_s, marked in said:
        phones = []
        for symbol in symbols:
            phones.append(Phone(symbol, clock, clock + length_s))
            clock += length_s
        words.append(TimedWord(Word("x", tuple(symbols), "," if marked else ""), tuple(phones)))
        clock += gap_s if gap_s > 1 else 0.0
    out = list(pace_words(words, Pace(max_lag_s)))
    assert [word.source for word in out] == words
    line = [phone for word in out for phone in word.phones]
    for before, after in itertools.pairwise(line):
        assert after.start >= before.end - 1e-9
    for word in out:
        assert all(phone.end > phone.start for phone in word.phones)
        if word.phones:
            assert -LEAD_S - 1e-6 <= word.lag_s <= max_lag_s + 1e-6
    starts = np.array([key.start for key in cue(line)])
    assert np.all(np.diff(starts) > 0.03)


def test_room_is_used_and_nothing_is_left_out_where_there_is_some() -> None:
    told, report = paced(news(4, 9.0))
    figures = report.report()
    assert figures["words_left_out"] == figures["mute_e_left_out"] == 0
    assert figures["lag_s"] <= 1.5
    assert figures["keys_per_s"] < 4.6  # measured 3.8
    assert all(row["readable"] for row in figures["subtitles"])
    assert len(told) == 4 * 15


@pytest.fixture(scope="module")
def hurried() -> tuple[list[PacedWord], PaceReport, list[str]]:
    """News of twice what can be cued: words, report, warnings."""
    told: list[PacedWord] = []
    lines: list[str] = []
    report = PaceReport(warn=lines.append)

    def tell(word: PacedWord) -> None:
        told.append(word)
        report(word)

    score_of_subtitles(news(5, 24.0), reading=Reading(pace=READABLE), on_word=tell)
    report.report()
    return told, report, lines


def test_what_does_not_fit_is_left_out_by_importance_and_reported(
    hurried: tuple[list[PacedWord], PaceReport, list[str]],
) -> None:
    told, report, _ = hurried
    figures = report.report()
    left = [word.source.word for word in told if not word.phones]
    assert left
    assert figures["words_left_out"] == len(left)
    assert figures["lag_s"] <= 1.5
    kept = {importance(word.source.word) for word in told if word.phones}
    assert "pas" not in {word.text for word in left}
    assert np.mean([importance(word) for word in left]) < np.mean(list(kept))
    assert not all(row["readable"] for row in figures["subtitles"])


def test_warns_by_subtitle_and_lists_the_words(
    hurried: tuple[list[PacedWord], PaceReport, list[str]],
) -> None:
    _, report, lines = hurried
    figures = report.report()
    short = [row for row in figures["subtitles"] if row["left_out"]]
    assert len([line for line in lines if "no time for" in line]) == len(short)
    assert all(" ".join(row["left_out"]) in "".join(lines) for row in short)


def test_a_text_without_a_programme_is_whole_and_slow() -> None:
    report = PaceReport()
    fast = score_of_text(TEXT * 12)
    slow = score_of_text(TEXT * 12, reading=Reading(pace=READABLE), on_word=report)
    assert len(slow.keys) == len(fast.keys)
    assert report.report()["words_left_out"] == 0
    assert report.report()["lag_s"] == 0
    length_s = slow.phones[-1].end - slow.phones[0].start
    assert len(slow.keys) / length_s == pytest.approx(3.4, abs=0.3)  # 2.5 syllables/s and pauses


@pytest.mark.parametrize("keys_per_s", [4.0, pytest.param(3.2, marks=pytest.mark.slow)])
def test_never_faster_than_a_quarter_more_in_any_three_seconds(keys_per_s: float) -> None:
    told, report = paced(news(12, 16.5), Pace(keys_per_s=keys_per_s))
    starts = np.array([key.start for key in cue([p for word in told for p in word.phones])])
    within = np.searchsorted(starts, starts + 3.0 - 1e-9) - np.arange(len(starts))
    assert within.max() <= 3.0 * 1.25 * keys_per_s
    # In the long run as fast as meant: what is left out is the price, and is reported.
    assert len(starts) / np.ptp(starts) < 1.15 * keys_per_s  # measured 1.02 and 1.11
    figures = report.report()
    whole = sum(row["keys_of_text"] for row in figures["subtitles"])
    assert figures["text_share"] == pytest.approx(len(starts) / whole, abs=0.02)
    assert 0.3 < figures["text_share"] < 0.9
    assert f"{100 * figures['text_share']:.1f} % of the text's keys" in str(report)


def test_slower_only_where_told() -> None:
    rates = []
    for syllables in (1.5, 2.5, 4.0):
        score = score_of_text(TEXT, reading=Reading(pace=Pace(1.5, syllables)))
        rates.append(len(score.keys) / (score.phones[-1].end - score.phones[0].start))
    assert rates[0] < rates[1] < rates[2]


def test_long_programmes_in_constant_memory() -> None:
    words = list(words_of_subtitles(news(60, 15.0), reading=Reading(pace=READABLE)))
    taken = 0

    def counted() -> Iterator[TimedWord]:
        nonlocal taken
        for word in words:
            taken += 1
            yield word

    assert next(pace_words(counted())).phones
    assert taken < len(words) / 4  # half a minute of more than five


def test_step_with_the_speaker_without_a_pace() -> None:
    plain = score_of_subtitles(news(3, 15.0))
    told: list[PacedWord] = []
    assert score_of_subtitles(news(3, 15.0), on_word=told.append) == plain
    assert max(abs(word.lag_s) for word in told) == 0


def test_links_of_words_left_out_go_too() -> None:
    assert links(Word("amis", ("z", "a", "m", "i")))
    assert not links(Word("zoo", ("z", "o")))
    assert not links(Word("ami", ("a", "m", "i")))


def test_taut_string_is_the_evenest() -> None:
    rng = np.random.default_rng(5)
    x = np.cumsum(rng.uniform(0.5, 1.5, 40))
    lower = np.cumsum(rng.uniform(0.0, 2.0, 40))
    upper = lower + 3.0
    course = taut_string(x, lower, upper)
    assert np.all(course >= lower - 1e-9)
    assert np.all(course <= upper + 1e-9)
    slopes = np.diff(course) / np.diff(x)
    # No chord of the tube that has to be crossed is as steep or as flat as the least slope says.
    i, j = np.triu_indices(40, 1)
    forced = (upper[j] - lower[i]) / (x[j] - x[i])
    assert slopes.min() == pytest.approx(min(forced.min(), slopes.min()))
    worse = np.interp(x, x[::13], course[::13])
    inside = np.all((worse >= lower) & (worse <= upper))
    assert not inside or np.sum(1 / np.diff(worse)) >= np.sum(1 / np.diff(course)) - 1e-9


@pytest.mark.parametrize(("lag_s", "syllables"), [(-1, 2.5), (float("nan"), 2.5), (1, 0.5), (1, 9)])
def test_impossible_paces_are_refused(lag_s: float, syllables: float) -> None:
    with pytest.raises(CueError, match="not within"):
        Pace(lag_s, syllables)
    with pytest.raises(CueError, match=r"11 keys/s are not within 1\.\.10"):
        Pace(keys_per_s=11)


def test_a_key_needs_what_its_ways_take() -> None:
    side, other, chin = (3, "side", 1), (5, "side", 1), (5, "chin", 2)
    assert least_s(other, side, side) == STILL_S
    assert least_s(side, other, side) < least_s(side, chin, side)
    assert 0.1 < least_s(None, side, None) < 0.25
