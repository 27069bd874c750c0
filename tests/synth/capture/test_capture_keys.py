"""Keys: where a cuer places her hand, when she arrives, what is too unsure to say."""

import itertools

import numpy as np

from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.voice import load_voice
from codec.cues.phonology import PHONE_NUMBER
from codec.cues.score import SHAPES
from synth.capture.cues.appearance import KEYS, looks_of
from synth.capture.cues.features import see_motion
from synth.capture.cues.line import KeyRun
from synth.capture.cues.recognise import HeldKey, _surer, arrival, recognise_keys
from synth.capture.cues.score import is_sure, score_of
from synth.capture.points.solve import resting
from synth.capture.points.speaker import Speaker
from synth.capture.sources.resample import resample
from synth.capture.tracker.closure import closures, rescaled
from synth.motion.rules.movement import law

VOICE = load_voice()
RATE_HZ = 50.0


def moving(line: list[tuple[int, int]], *, hold_s: float = 0.2, move_s: float = 0.2) -> np.ndarray:
    """Return parameters that go from key to key, from rest and back."""
    rest = resting(Speaker(VOICE, VOICE.face, VOICE.hand))
    rows = [rest]
    for shape, place in line:
        row = rest.copy()
        row[VOICE.hand_columns] = np.concatenate(
            [VOICE.gestures.shape_targets[shape], VOICE.gestures.placement_targets[shape, place]]
        )
        rows.append(row)
    rows.append(rest)
    hold, move = round(hold_s * RATE_HZ), round(move_s * RATE_HZ)
    part = law("minimum-jerk")(np.arange(1, move + 1) / move)[:, None]
    out = [np.tile(rest, (hold, 1))]
    for a, b in itertools.pairwise(rows):
        out += [a + part * (b - a), np.tile(b, (hold, 1))]
    return np.concatenate(out)


def test_keys_are_as_sure_at_any_frame_rate() -> None:
    """Finer frames hold more ways to lay a line; they must neither add keys nor take away trust."""
    rng = np.random.default_rng(9)
    params = moving([KEYS[k] for k in rng.permutation(np.arange(1, len(KEYS)))[:10]])
    times = np.arange(len(params)) / RATE_HZ
    params += resample(rng.normal(scale=0.5, size=(len(times) // 5 + 2, 31)), 10.0, times)
    counts, sure = [], []
    for rate_hz in (25.0, 50.0, 100.0):
        frames = resample(params, RATE_HZ, np.arange(0.0, times[-1], 1.0 / rate_hz))
        held = recognise_keys(see_motion(VOICE, frames, rate_hz=rate_hz), looks=looks_of(VOICE))
        counts.append(sum(one.shape > 0 for one in held.held))
        sure.append(np.mean([one.confidence for one in held.held if one.shape]))
    assert len(set(counts)) == 1
    assert max(sure) - min(sure) < 0.05


def test_learnt_looks_lose_no_stretch_that_was_surer_without_them() -> None:
    rest, first, last = KeyRun(0, 0, 9, 1.0), KeyRun(5, 10, 20, 0.9), KeyRun(7, 50, 60, 0.9)
    sure, unsure = KeyRun(3, 25, 40, 0.8), KeyRun(4, 25, 40, 0.4)
    plain, learnt = [rest, first, sure, last], [rest, first, unsure, last]
    assert _surer(plain, learnt) == plain
    assert _surer(learnt, plain) == plain
    assert _surer([rest, first, KeyRun(3, 25, 40, 0.45), last], learnt) == learnt  # as good as even
    # Keys that are likelier wrong than right are no gain, nor is a key at another time.
    assert _surer([rest, first, unsure, last], [rest, first, last]) == [rest, first, last]
    assert _surer([rest, KeyRun(5, 30, 35, 0.9)], [rest, first]) == [rest, first]
    assert _surer([], learnt) == learnt


def told(params: np.ndarray) -> tuple[HeldKey, ...]:
    seen = see_motion(VOICE, params, rate_hz=RATE_HZ)
    return recognise_keys(seen, looks=looks_of(VOICE)).held


def test_every_key_is_recognised_where_it_is_held() -> None:
    rng = np.random.default_rng(4)
    line = [KEYS[k] for k in rng.permutation(np.arange(1, len(KEYS)))]
    held = told(moving(line))
    keys = [one for one in held if one.shape]
    assert [(one.shape, one.placement) for one in keys] == line
    reached = 0.4 + 0.4 * np.arange(len(line))
    late = np.array([one.reach_s for one in keys]) - reached
    assert np.abs(np.median(late)) < 0.021
    assert np.abs(late).max() < 0.11
    assert held[0].shape == held[-1].shape == 0
    assert min(one.confidence for one in keys) > 0.3
    assert is_sure(held)


def test_a_key_that_is_formed_before_the_hand_moves_is_reached_when_it_has() -> None:
    still = np.full(10, 5.0)
    stroke = 100.0 * np.sin(np.linspace(0.0, np.pi, 21)) + 1.0
    flow = np.concatenate([still, stroke, still])
    assert arrival(flow, 8, 12, 41) == arrival(flow, 8, 22, 41) >= 28
    # Until its end the hand only sets out again: it had arrived at the beginning.
    assert arrival(flow, 8, 10, 18) == 10


def test_a_hand_that_only_slows_down_has_not_arrived() -> None:
    hump = np.sin(np.linspace(0.0, np.pi, 21))
    flow = np.concatenate([200.0 * hump[:-6], 90.0 + 60.0 * hump, 100.0 * hump[10:], np.zeros(10)])
    dip = 14 + int(flow[14:20].argmin())
    assert flow[dip] > 0.3 * flow.max()
    assert arrival(flow, 0, dip - 1, len(flow)) >= 40
    # Strokes that overlap leave nothing slower: it was there when it was slowest.
    assert arrival(flow[:36], 0, dip - 1, 36) in range(dip - 1, 36)
    assert arrival(flow[:25], 0, dip - 1, 25) == dip


def test_fingers_that_change_alone_tell_when_a_key_is_reached() -> None:
    seen = see_motion(VOICE, moving([(2, 1), (3, 1)], hold_s=1.0), rate_hz=RATE_HZ)
    change = slice(round(2.1 * RATE_HZ), round(2.5 * RATE_HZ))
    assert np.nanmax(seen.flow()[change]) > 5.0 * np.nanmax(seen.speed[change])
    np.testing.assert_array_less(seen.speed - 1e-9, seen.flow())


def test_a_sound_alone_begins_when_the_hand_arrives() -> None:
    held = [HeldKey(3, 1, 0.5, 0.8, 0.9), HeldKey(6, 1, 1.0, 1.2, 0.9)]
    score = score_of(
        held,
        VOICE,
        np.zeros((100, len(VOICE.layout))),
        rate_hz=RATE_HZ,
        start_s=2.0,
        given=[("s",), ("w", "a")],
    )
    assert [round(key.start, 3) for key in score.keys] == [2.5, 2.967]
    assert score.keys[0].end == score.keys[1].start


def test_without_depth_keys_are_still_told() -> None:
    line = [(5, 1), (1, 3), (4, 2), (3, 5), (6, 4), (2, 1), (8, 2), (7, 3)]
    held = told(moving(line))
    assert [(one.shape, one.placement) for one in held if one.shape] == line


def test_a_hand_that_never_holds_a_key_is_unsure() -> None:
    assert not is_sure([])
    assert not is_sure([HeldKey(0, 0, 0.0, 1.0, 1.0)])
    assert not is_sure([HeldKey(5, 1, 0.0, 1.0, 0.3), HeldKey(4, 1, 1.0, 2.0, 0.9)])


def test_closures_tell_the_shapes_and_grow_to_scale() -> None:
    targets = VOICE.gestures.shape_targets
    plain = closures(VOICE, targets)
    assert plain[[0, 1, 2, 8], 3].min() > 0.9
    assert np.abs(plain[[3, 4, 5], 3]).max() < 0.1
    # A tracker that reads all fingers half open.
    half = targets[5] + 0.5 * (targets - targets[5])
    takes = np.tile(half.astype(float), (20, 1))
    better = closures(VOICE, rescaled(VOICE, takes, np.ones(len(takes), dtype=bool))[: len(SHAPES)])
    assert (
        np.abs(better[:, 1:5] - plain[:, 1:5]).mean()
        < 0.5 * np.abs(closures(VOICE, half)[:, 1:5] - plain[:, 1:5]).mean()
    )
    few = takes[:9]
    np.testing.assert_array_equal(rescaled(VOICE, few, np.ones(9, dtype=bool)), few)


def test_lips_choose_among_the_phones_of_a_key() -> None:
    line = [(1, 3), (5, 3), (4, 2)]
    params = moving(line, hold_s=0.3)
    face = VOICE.face_columns[:N_FACE_PARAMETERS]
    held = told(params)
    for phones in (("p", "u"), ("d", "ɛ")):
        first = next(one for one in held if one.shape == 1)
        begin, end = round(first.reach_s * RATE_HZ), round(first.leave_s * RATE_HZ)
        middle = begin + 7
        spoken = params.copy()
        for a, b, symbol in ((begin - 2, middle, phones[0]), (middle, end + 9, phones[1])):
            spoken[a:b, face] = VOICE.gestures.viseme_targets[PHONE_NUMBER[symbol]]
        score = score_of(held, VOICE, spoken, rate_hz=RATE_HZ, start_s=0.0)
        assert score.keys[0].phones == phones
