"""The score of a whole file, stated once."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codec.analysis.compare import compare_motions
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions, cue
from codec.cues.phonology import PHONES
from codec.cues.score import Phone, Score
from codec.cues.timeline import ScoreLine, to_line
from codec.errors import BitstreamError
from codec.streamfile.content import common_data, read_superframes
from codec.streamfile.file_score import FileScore, read_common, trimmed, write_common
from codec.streamfile.learning import Learner
from codec.streamfile.stream import decode_stream, encode_stream
from codec.streamfile.whole_score import WholeResynthesis
from codec.superframe.coding import coding_for
from codec.superframe.merging import join_line
from codec.superframe.score_coding import part_of

INDICES = range(2, 7)


def lines() -> st.SearchStrategy[ScoreLine]:
    """Lines of phones around the superframes of a file, silences of all lengths among them."""
    phone = st.tuples(st.integers(0, 37), st.integers(1, 70))

    def line(first: int, phones: list[tuple[int, int]]) -> ScoreLine:
        numbers, starts, tick = [0], [-(1 << 40)], first
        for number, ticks in phones:
            if number or numbers[-1]:
                numbers.append(number)
                starts.append(tick)
                tick += ticks
        if numbers[-1]:
            numbers.append(0)
            starts.append(tick)
        return ScoreLine(tuple(numbers), tuple(starts), {})

    return st.builds(line, st.integers(-10, 300), st.lists(phone, max_size=30))


@settings(max_examples=200, deadline=None)
@given(lines(), st.booleans(), st.booleans())
def test_common_data_are_read_as_written(line: ScoreLine, cheek: bool, learning: bool) -> None:
    options = replace(DEFAULT_OPTIONS, schwa="cheek" if cheek else "side")
    common = FileScore(trimmed(line, INDICES), options, learning)
    again = read_common(write_common(common, INDICES), INDICES)
    assert again.options == options
    assert again.learning == learning
    assert common.line is not None
    assert again.line is not None
    # What sounds before the first superframe is stated from its last tick on at most.
    assert again.line.numbers == common.line.numbers
    assert again.line.starts[1:] == common.line.starts[1:]


@settings(max_examples=100, deadline=None)
@given(lines(), st.integers(0, 30), st.integers(0, 8), st.integers(0, 5))
def test_replaced_keys_are_kept(line: ScoreLine, which: int, shape: int, place: int) -> None:
    line = trimmed(line, INDICES)
    parts = {k: part_of(line, k) for k in INDICES}
    starts = [k * 32 + s for k, part in parts.items() for s in part.key_starts()]
    if not starts:
        return
    line = replace(line, overrides={starts[which % len(starts)]: (shape, place)})
    again = read_common(write_common(FileScore(line, DEFAULT_OPTIONS, False), INDICES), INDICES)
    assert again.line is not None
    assert again.line.overrides == line.overrides


@settings(max_examples=200, deadline=None)
@given(st.binary(min_size=1, max_size=40))
def test_any_bytes_are_a_score_or_an_error(data: bytes) -> None:
    try:
        common = read_common(data, INDICES)
    except BitstreamError:
        return
    assert common.line is not None
    assert all(0 <= number < len(PHONES) for number in common.line.numbers)
    assert list(common.line.starts) == sorted(common.line.starts)


def test_keys_read_off_a_hand_take_few_bits() -> None:
    """Ten keys of 0.3 s, their consonants of the usual part: less than 15 bits each."""
    phones = []
    for i, pair in enumerate(("ka", "li", "tu", "de", "na") * 2):
        start = 4.0 + 0.3 * i
        middle = start + 0.12
        phones += [Phone(pair[0], start, middle), Phone(pair[1], middle, start + 0.3)]
    score = Score(tuple(phones), tuple(cue(phones)))
    line = trimmed(to_line(score), range(5, 13))
    data = write_common(FileScore(line, DEFAULT_OPTIONS, True), range(5, 13))
    assert len(data) < 10 * 15 / 8 + 6


def learner_of(voice: Voice, score: Score, indices: range) -> tuple[Learner, WholeResynthesis]:
    coding = coding_for(voice)
    line = trimmed(to_line(score), indices)
    parts = {k: part_of(line, k) for k in range(indices.start - 1, indices.stop + 1)}
    moved = WholeResynthesis(join_line(line, parts), coding.targets)
    return Learner(moved, coding), moved


def cued(count: int) -> Score:
    phones = [
        Phone("kalitu"[i % 6], round(0.5 + 0.2 * i, 2), round(0.7 + 0.2 * i, 2))
        for i in range(count)
    ]
    return Score(tuple(phones), tuple(cue(phones)))


def test_targets_of_another_cuer_are_learnt(toy_voice: Voice) -> None:
    """A hand that is held elsewhere is predicted better and better."""
    indices = range(20)
    learner, moved = learner_of(toy_voice, cued(60), indices)
    rng = np.random.default_rng(3)
    face, width = 7, len(toy_voice.layout)
    shift = np.concatenate([np.zeros(face), rng.normal(size=width - face)])
    lacks = []
    for index in indices:
        block = moved.params(index) + shift
        lacks.append(float(np.abs(block - learner.params(index))[:, face : face + 12].mean()))
        learner.take(index, block)
    assert lacks[15] < 0.25 * lacks[0]


def test_nothing_learnt_changes_nothing(toy_voice: Voice) -> None:
    learner, moved = learner_of(toy_voice, cued(20), range(6))
    for index in range(6):
        np.testing.assert_array_equal(learner.params(index), moved.params(index))
        learner.take(index, moved.params(index))
        np.testing.assert_allclose(learner.params(index), moved.params(index), atol=1e-12)


def moving(voice: Voice, *, kept: bool) -> Motion:
    """A hand that keeps to its score with other targets, or has nothing to do with it."""
    indices = range(12)
    score = cued(32)
    _, moved = learner_of(voice, score, indices)
    params = np.concatenate([moved.params(index) for index in indices])
    rng = np.random.default_rng(5)
    if not kept:
        params = np.cumsum(rng.normal(size=params.shape), axis=0) / 8
    params[:, 7:] += rng.normal(size=params.shape[1] - 7)
    return Motion(params.astype(np.float32), 50.0, 0.0, voice.layout, voice.identity, score)


@pytest.mark.parametrize("kept", [True, False])
def test_a_score_that_tells_nothing_costs_itself(toy_voice: Voice, kept: bool) -> None:
    """Prediction and learning are left alone where they do not pay."""
    motion = moving(toy_voice, kept=kept)
    scored = encode_stream(motion, toy_voice, error_mm=3.0, score="keep")
    bare = encode_stream(replace(motion, score=None), toy_voice, error_mm=3.0)
    frames = list(read_superframes(scored))
    assert len(scored) <= 1.02 * len(bare) + len(rewritten(scored)) + len(frames)
    found = decode_stream(scored, toy_voice)
    # The toy's models are far from linear.
    assert compare_motions(motion, found, toy_voice).marker_rms_mm < 1.2 * 3.0
    assert found.score is not None
    assert motion.score is not None
    assert [str(key) for key in found.score.keys] == [str(key) for key in motion.score.keys]


def rewritten(data: bytes) -> bytes:
    common = common_data(data)
    return write_common(common, range(12))


def test_options_of_cueing_are_kept(toy_voice: Voice) -> None:
    options = CueingOptions(schwa="cheek", rest_gap_s=1.0)
    phones = [Phone("k", 0.5, 0.7), Phone("ə", 0.7, 1.0)]
    score = Score(tuple(phones), tuple(cue(phones, options)))
    motion = replace(moving(toy_voice, kept=True), score=score)
    data = encode_stream(motion, toy_voice, rate_bps=900, score="keep", options=options)
    assert common_data(data).options == options
    found = decode_stream(data, toy_voice)
    assert found.score is not None
    assert [key.placement for key in found.score.keys] == ["cheek"]
