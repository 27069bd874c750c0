"""Passages of a score, and how what is made of them flows together."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from codec.cues.cueing import cue
from codec.cues.score import Phone, Score
from synth.planning.prosody.passages import AROUND_S, LONGEST_S, SILENCE_S, ScorePassage, passages
from synth.units.concatenation.assembly import Flow

LINES = st.lists(
    st.tuples(
        st.sampled_from("b a l i t ə s u".split()),
        st.floats(0.02, 0.4),
        st.one_of(st.just(0.0), st.floats(0.0, 3.0)),
    ),
    min_size=1,
    max_size=120,
)


def score_of(line: list[tuple[str, float, float]]) -> Score:
    phones, clock = [], 0.5
    for symbol, length, gap in line:
        phones.append(Phone(symbol, clock, clock + length))
        clock += length + gap
    return Score(tuple(phones), tuple(cue(phones)))


def endless(seconds: float) -> Score:
    return score_of([("b", 0.06, 0.0), ("a", 0.14, 0.0)] * round(seconds / 0.2))


@given(LINES)
def test_passages_hold_everything_once_and_in_order(line: list[tuple[str, float, float]]) -> None:
    score = score_of(line)
    found = list(passages([score]))
    assert tuple(p for passage in found for p in passage.score.phones) == score.phones
    assert tuple(k for passage in found for k in passage.score.keys) == score.keys
    for passage in found:
        assert passage.start_s <= passage.score.phones[0].start
        assert passage.end_s >= passage.score.phones[-1].end
        assert set(passage.score.phones) <= set(passage.around.phones)
    for before, after in itertools.pairwise(found):
        assert before.end_s <= after.start_s + 1e-9


@given(LINES, st.data())
def test_pieces_change_nothing(line: list[tuple[str, float, float]], data: st.DataObject) -> None:
    score = score_of(line)
    at = data.draw(st.integers(0, len(score.keys)))
    time = score.keys[at].start if at < len(score.keys) else 1e9
    pieces = [
        Score(
            tuple(p for p in score.phones if (p.start < time - 1e-9) == first),
            tuple(k for k in score.keys if (k.start < time - 1e-9) == first),
        )
        for first in (True, False)
    ]
    assert list(passages(pieces)) == list(passages([score]))


def test_an_endless_line_is_cut_between_keys_and_knows_its_neighbours() -> None:
    score = endless(100)
    found = list(passages([score]))
    assert len(found) > 3
    for passage in found:
        assert passage.end_s - passage.start_s <= LONGEST_S + 2
        assert all(len(key.phones) == 2 for key in passage.score.keys)
    middle = found[1]
    assert middle.around.phones[0].start == pytest.approx(middle.start_s - AROUND_S, abs=0.25)
    assert middle.around.phones[-1].end == pytest.approx(middle.end_s + AROUND_S, abs=0.25)


def test_the_cut_falls_into_the_widest_gap() -> None:
    line = [("b", 0.06, 0.0), ("a", 0.14, 0.0)] * 200
    line[201] = ("a", 0.14, 0.8 * SILENCE_S)
    first, *_ = passages([score_of(line)])
    assert len(first.score.phones) == 202


def flowed(found: list[ScorePassage], start: int | None = None) -> list[tuple[int, int, int]]:
    flow = Flow(50.0, 1000, start)
    parts = []
    for value, passage in enumerate(found):
        first, last = round(passage.start_s * 50), round(passage.end_s * 50)
        frames = np.full((last + flow.fade_frames - first, 1), float(value))
        sound = np.zeros(flow.sample(last + flow.fade_frames) - flow.sample(first), np.float32)
        for at, made, samples in flow.join(first, last, frames, sound):
            assert len(samples) == flow.sample(at + len(made)) - flow.sample(at)
            parts.append((at, len(made), len(samples)))
    return parts


@given(LINES, st.sampled_from([None, 0, 20]))
def test_a_flow_has_no_gap(line: list[tuple[str, float, float]], start: int | None) -> None:
    parts = flowed(list(passages([score_of(line)])), start)
    for before, after in itertools.pairwise(parts):
        assert before[0] + before[1] == after[0]
    if start is not None and parts:
        assert parts[0][0] == start


def test_passages_fade_into_each_other_and_the_cuer_is_still_between_them() -> None:
    flow = Flow(50.0, 1000)

    def made(value: float, frames: int) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
        n = frames + flow.fade_frames
        return np.full((n, 1), value), np.full(20 * n, value, dtype=np.float32)

    out = [*flow.join(0, 100, *made(0.0, 100)), *flow.join(150, 250, *made(1.0, 100))]
    assert [(at, len(params)) for at, params, _ in out] == [(0, 100), (100, 50), (150, 100)]
    params = np.concatenate([params for _, params, _ in out])[:, 0]
    assert (params[:150] == 0).all()
    assert (params[170:] == 1).all()
    assert (np.diff(params[150:170]) > 0).all()
    assert np.diff(params).max() < 0.1
    sound = np.concatenate([sound for _, _, sound in out])
    assert (sound[2000:3000] == 0).all()
    assert len(sound) == 5000
