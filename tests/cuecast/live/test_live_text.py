"""Live text: late, in pieces, without an end; the cuer follows and catches up."""

import itertools
import json

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.score import Key
from codec.errors import CueError
from cuecast.live.text import AHEAD_S, Caption, LiveMotion, read_caption
from synth.planning.scoring.text_score import Reading, keys_of

VOICE = load_voice("claire")
LONG = "Les enfants jouent dans le jardin avec le chien du voisin."


def follow(captions: list[tuple[float, Caption]], until_s: float) -> tuple[LiveMotion, list[Key]]:
    """Ask for the motion window by window, as captions come; return it and all keys."""
    motion = LiveMotion(VOICE, Reading())
    keys: dict[tuple[float, int, str], Key] = {}
    coming = sorted(captions, key=lambda one: one[0])
    for start in np.arange(0, until_s, 0.64):
        while coming and coming[0][0] <= start:
            motion.add(coming.pop(0)[1])
        motion.window(float(start), 32)
        keys |= {(key.start, key.shape, key.placement): key for key in motion.score.keys}
    return motion, sorted(keys.values(), key=lambda key: key.start)


def test_keys_are_those_of_the_text() -> None:
    _, keys = follow([(1.0, Caption(0.5, "Bonjour à tous."))], 8)
    wanted = keys_of("Bonjour à tous.")
    assert [(k.shape, k.placement) for k in keys] == [(k.shape, k.placement) for k in wanted]


def test_nothing_is_cued_before_it_is_known() -> None:
    for came_s in (0.7, 3.0, 5.5):
        _, keys = follow([(came_s, Caption(came_s - 2, LONG))], came_s + 10)
        known_s = 0.64 * np.ceil(came_s / 0.64)
        assert keys[0].start >= known_s + AHEAD_S - 1e-6
        assert keys[0].start <= known_s + AHEAD_S + 0.7


def test_text_is_cued_in_order_and_never_at_once() -> None:
    captions = [(n * 0.2, Caption(n * 0.2, LONG)) for n in range(3)]
    motion, keys = follow(captions, 25)
    assert motion.captions == 3
    assert all(a.end <= b.start + 1e-6 for a, b in itertools.pairwise(keys))


def test_lag_is_caught_up_in_a_pause() -> None:
    rush = [(n * 1.0, Caption(n * 1.0, LONG)) for n in range(4)]
    motion, _ = follow(rush, 4.5)
    assert motion.lag_s > 3
    motion, keys = follow([*rush, (30.0, Caption(30.0, "Bonsoir."))], 40)
    assert motion.lag_s < 1.2
    assert keys[-1].end > 30
    slow, _ = follow(rush[:1], 20)
    assert slow.captions == 1


def test_who_lags_hurries() -> None:
    _, alone = follow([(0.0, Caption(0.0, LONG))], 20)
    _, rushed = follow([(n * 0.1, Caption(0.0, LONG)) for n in range(3)], 30)
    count = len(alone)
    last = rushed[-1].end - rushed[-count].start
    assert last < 0.85 * (alone[-1].end - alone[0].start)


def test_what_comes_far_too_late_is_left_out_and_counted() -> None:
    motion, _ = follow([(0.0, Caption(0.0, LONG)) for _ in range(12)], 10)
    assert motion.left_out > 0
    assert motion.captions + motion.left_out == 12


def test_memory_does_not_grow() -> None:
    motion, _ = follow([(n * 4.0, Caption(n * 4.0, "Bonjour.")) for n in range(12)], 52)
    assert motion.captions == 12
    assert len(motion.score.keys) < 20


def test_lines() -> None:
    assert read_caption(b'{"text": "Oui"}', 12.0) == Caption(12.0, "Oui")
    assert read_caption('{"text": "Oui", "age": 3, "more": 1}', 12.0) == Caption(9.0, "Oui")
    assert read_caption('{"text": "Oui", "start": 99}', 12.0) == Caption(12.0, "Oui")
    assert read_caption(b" \n", 12.0) is None


@pytest.mark.parametrize(
    "line",
    ["Bonjour", "[]", "{}", '{"text": 3}', '{"text": "a", "age": "b"}', '{"text": "a", "age": NaN}',
     '{"text": "a", "age": 1e99}', json.dumps({"text": "a" * 3000}), "[" * 100_000, b"\xff\xfe"],
)  # fmt: skip
def test_lines_that_are_none(line: str | bytes) -> None:
    with pytest.raises(CueError, match="live text: not a"):
        read_caption(line, 5.0)
