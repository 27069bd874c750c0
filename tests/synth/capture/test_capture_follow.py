"""Keys of a text whose times are unknown: found, left out, told when they are another text's."""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENT_NUMBER, PLACEMENTS, Key, Score
from codec.errors import CueError
from synth.capture.cues import _kernels
from synth.capture.cues.appearance import ANYBODYS, KEYS, KeyExamples, looks_of
from synth.capture.cues.between import KeyExample, between_fingers, between_places, between_stances
from synth.capture.cues.features import HandFeatures, fingers_of
from synth.capture.cues.follow import Followed, follow_keys
from synth.capture.cues.lattice import END_OF, SHAPE_OF, lattice
from synth.capture.cues.line import KeyRun, nearness, prices
from synth.capture.cues.recognise import HeldKey, _stayed, least_held_s, recognise_keys
from synth.capture.cues.transcript import read_transcript

RATE_HZ = 30.0


def shown(
    line: list[tuple[int, int]], *, hold: int = 3, move: int = 6, seed: int = 1
) -> HandFeatures:
    """Return a hand that goes from key to key, from out of the picture and back."""
    rng = np.random.default_rng(seed)
    looks = ANYBODYS
    states = [(0, 0), *line, (0, 0)]
    fingers, tips, stances = [], [], []
    for (s, p), (t, q) in itertools.pairwise(states):
        part = np.concatenate([np.linspace(0, 1, move), np.ones(hold)])[:, None]
        fingers.append(looks.fingers[s] + part * (looks.fingers[t] - looks.fingers[s]))
        tips.append(looks.places[p] + part * (looks.places[q] - looks.places[p]))
        stances.append(looks.stances[p] + part * (looks.stances[q] - looks.stances[p]))
    x, y = np.concatenate(fingers), np.concatenate(tips)
    x = x + 0.05 * rng.normal(size=x.shape)
    y = y + 2.0 * rng.normal(size=y.shape)
    both = np.stack([y, y], axis=1)
    speed = np.linalg.norm(np.gradient(np.concatenate(tips), axis=0), axis=1) * RATE_HZ
    seen = HandFeatures(RATE_HZ, x, both, both, speed, np.concatenate(stances))
    for values in (seen.fingers, seen.tips, seen.pointers, seen.speed, seen.stance):
        values[:4] = values[-4:] = np.nan
    return seen


def numbered(keys: tuple[Key, ...]) -> list[tuple[int, int]]:
    return [(key.shape, PLACEMENT_NUMBER[key.placement]) for key in keys]


TEXT = read_transcript("v u p u v e l i b ɔ̃ l ɛ d m y ʁ i f ɔ̃")


def test_a_text_is_found_where_the_hand_shows_it() -> None:
    found = follow_keys(shown(numbered(TEXT.keys)), TEXT.keys)
    assert found.believed
    held = [one for one in found.held if one is not None]
    assert [(one.shape, one.placement) for one in held] == numbered(TEXT.keys)
    reached = [(9 * (number + 1) - 3) / RATE_HZ for number in range(len(held))]
    np.testing.assert_allclose([one.reach_s for one in held], reached, atol=0.15)


def test_another_text_is_told() -> None:
    other = read_transcript("t a ʃ ø a m ɑ̃ ʒ e t u l ə ɡ a t o".replace("ɡ", "g"))
    assert not follow_keys(shown(numbered(TEXT.keys)), other.keys).believed


def test_a_key_that_was_left_out_is_left_out() -> None:
    line = numbered(TEXT.keys)
    found = follow_keys(shown(line[:4] + line[5:]), TEXT.keys)
    assert [one is None for one in found.held].count(True) <= 2
    assert found.held[4] is None or found.held[4].confidence < 0.5


def test_a_vowel_that_is_cued_elsewhere_is_taken_as_shown() -> None:
    text = read_transcript("m o t i d y")
    line = numbered(text.keys)
    line[0] = (5, PLACEMENT_NUMBER["chin"])
    held = follow_keys(shown(line), text.keys).held[0]
    assert held is not None
    assert PLACEMENTS[held.placement] == "chin"


def test_a_take_with_no_hand_shows_no_text() -> None:
    seen = shown(numbered(TEXT.keys))
    for values in (seen.fingers, seen.tips, seen.pointers, seen.speed):
        values[:] = np.nan
    found = follow_keys(seen, TEXT.keys)
    assert not found.believed
    assert set(found.held) == {None}
    assert not [one for one in recognise_keys(seen).held if one.shape]


def test_pieces_do_not_show() -> None:
    """A take longer than a piece has the keys of the same take made shorter."""
    line = numbered(TEXT.keys) * 8
    long = recognise_keys(shown(line)).held
    assert [(one.shape, one.placement) for one in long if one.shape] == line


def test_the_kernels_agree_with_their_python(monkeypatch: pytest.MonkeyPatch) -> None:
    densities = lattice(shown([(5, 1), (2, 3)]), ANYBODYS)
    hold, enter = densities.hold[:, :9], prices(ANYBODYS)[:9, :9]
    way = np.stack([[densities.way([a], [b]) for b in range(9)] for a in range(9)]).transpose(
        2, 0, 1
    )
    tables = (densities.shapes, densities.places, SHAPE_OF[:9], END_OF[:9])
    states = np.empty((2, len(hold)), dtype=np.int64)
    near = np.empty((2, *hold.shape))
    kinds: list[Any] = [
        (_kernels.likeliest, _kernels.nearness, _kernels.follow),
        tuple(k.py_func for k in (_kernels.likeliest, _kernels.nearness, _kernels.follow)),
    ]
    for number, (likeliest, near_of, _) in enumerate(kinds):
        likeliest(hold, *tables, enter, -3.0, states[number])
        near_of(hold, *tables, enter, -3.0, near[number])
    np.testing.assert_array_equal(states[0], states[1])
    np.testing.assert_allclose(near[0], near[1], atol=1e-9)
    line, pair = np.array([0, 1, 3, 0]), np.array([[-1, -1], [1, -1], [12, 3], [27, 9]])
    omit, low, high = np.zeros(4), np.zeros(len(hold), int), np.full(len(hold), 4)
    at = np.empty((2, 4), dtype=np.int64)
    for number, follow in enumerate(kind[2] for kind in kinds):
        follow(
            hold,
            np.ascontiguousarray(way.reshape(len(hold), -1)),
            line,
            pair,
            omit,
            low,
            high,
            at[number],
            states[number],
        )
    np.testing.assert_array_equal(at[0], at[1])
    np.testing.assert_array_equal(states[0], states[1])


def test_nearness_is_a_probability() -> None:
    near = nearness(lattice(shown([(5, 1), (2, 3), (1, 2)]), ANYBODYS), ANYBODYS)
    assert near.min() >= 0
    assert near.max() <= 1 + 1e-9


def test_looks_are_learnt_as_far_as_they_are_shown() -> None:
    own = np.array([-50.0, -20.0])
    few = ANYBODYS.learnt(KeyExamples(places=(KeyExample(2, own, 1.0),)), ANYBODYS)
    many = ANYBODYS.learnt(KeyExamples(places=(KeyExample(2, own, 1.0),) * 40), ANYBODYS)
    gap = [float(np.abs(x.places[2] - own).sum()) for x in (ANYBODYS, few, many)]
    assert gap[0] > gap[1] > gap[2]
    assert (many.places_sd[2] < few.places_sd[2]).all()
    # All places are a little where this one is; no shape is changed by it.
    assert np.abs(many.places[3] - ANYBODYS.places[3]).max() < 0.5 * gap[0]
    np.testing.assert_array_equal(many.fingers, ANYBODYS.fingers)


def test_a_thumb_shows_in_all_shapes_that_hold_it_so() -> None:
    """Two shapes with the thumb beside the palm tell of the others that fold it, not of those
    that have it out, and of no finger."""
    thumb = np.zeros(7)
    thumb[4] = 0.3
    shown = tuple(KeyExample(s, ANYBODYS.fingers[s] + thumb, 1.0) for s in (1, 2) for _ in range(4))
    moved = ANYBODYS.learnt(KeyExamples(fingers=shown), ANYBODYS).fingers - ANYBODYS.fingers
    assert (moved[[3, 4, 8], 4] > 0.2).all()
    assert np.abs(moved[[5, 6, 7], 4]).max() < 0.02
    np.testing.assert_allclose(np.delete(moved, 4, axis=1), 0.0, atol=1e-12)


def test_differences_between_cuers_are_covariances() -> None:
    for covariance in (
        between_fingers(),
        *between_places(ANYBODYS.places),
        *between_stances(0.04, 0.02),
    ):
        np.testing.assert_allclose(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > 0


def test_fingers_of_a_turned_hand_are_the_same() -> None:
    hand = np.random.default_rng(2).normal(scale=40.0, size=(3, 21, 2))
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    np.testing.assert_allclose(fingers_of(hand), fingers_of(1.7 * hand @ turn.T + 9.0), atol=1e-9)


def test_looks_of_a_voice_are_near_anybodys() -> None:
    looks = looks_of(load_voice())
    assert np.abs(looks.places[1:] - ANYBODYS.places[1:]).max() < 45.0
    assert len(KEYS) == 41


def test_transcripts_are_texts_or_phones() -> None:
    assert read_transcript("b o~ z^ u r").keys == read_transcript("b ɔ̃ ʒ u ʁ").keys
    # What corpora write o^ is closed, what they write o is open; IPA is as ever.
    placed = {
        "b o~ v o^": "side",
        "b o~ d o r": "chin",
        "b ɔ̃ v o": "side",
        "v o p o": "side",
        "<start> v o l <end>": "chin",
        "b o~ m x^": "side",
        "b o~ m x_": "cheek",
    }
    for text, placement in placed.items():
        vowels = [k for k in read_transcript(text).keys if k.phones[-1] in ("o", "ɔ", "œ", "ø")]
        assert vowels[-1].placement == placement, text
    paused = read_transcript("<start> b o~ z^ u r _ m a d a m <end>")
    assert isinstance(paused, Score)
    assert len(paused.keys) == 6
    with pytest.raises(CueError, match="nothing that is spoken"):
        read_transcript("...")


def test_a_hand_that_passes_a_key_does_not_show_it() -> None:
    """Next to rest a key must be held; within a phrase it may be short."""
    rest, short, held = KEYS.index((0, 0)), KEYS.index((5, 5)), KEYS.index((2, 3))
    runs = [
        KeyRun(rest, 0, 20, 1.0),
        KeyRun(short, 22, 24, 0.3),
        KeyRun(held, 30, 40, 0.9),
        KeyRun(short, 45, 47, 0.6),
        KeyRun(held, 52, 60, 0.9),
        KeyRun(short, 62, 63, 0.3),
    ]
    assert _stayed(runs, 30.0) == [runs[0], *runs[2:5]]
    assert _stayed(runs, 50.0) == [runs[0], *runs[2:5]]
    longer = [runs[0], replace(runs[1], end=27), *runs[2:]]
    assert _stayed(longer, 30.0) == longer[:-1]


def test_few_keys_agree_by_chance() -> None:
    held = [HeldKey(1, 1, 0.0, 0.1, 0.5)] * 36
    assert Followed(tuple(held), 0.6, ANYBODYS).believed
    assert not Followed(tuple(held[:9]), 0.6, ANYBODYS).believed
    assert Followed(tuple(held[:9]), 0.64, ANYBODYS).believed


def test_a_noisy_film_is_not_asked_to_be_sure() -> None:
    """The right text is as sure as the film is of its own keys; no text is of a hand that waves."""
    held = tuple([HeldKey(1, 1, 0.0, 0.1, 0.5)] * 16)
    assert Followed(held, 0.4, ANYBODYS, 0.5).believed
    assert not Followed(held, 0.4, ANYBODYS, 0.8).believed
    assert not Followed(held, 0.25, ANYBODYS, 0.3).believed


def test_fingers_are_shortened_together() -> None:
    """A palm that turns away is likelier than fingers that disagree by as much."""
    together = np.array([-0.2, -0.2, -0.2, -0.2, 0.0, 0.0, 0.0])
    apart = together * [1, -1, 1, -1, 0, 0, 0]
    fits = []
    for off in (together, apart):
        seen = shown([(4, 3)], hold=9)
        seen.fingers[:] += off
        fits.append(lattice(seen, ANYBODYS).hold[10:14, KEYS.index((4, 3))].sum())
    assert fits[0] > fits[1] + 1.0


def test_fingers_ahead_of_the_hand_are_no_key_of_their_own() -> None:
    rest, mouth, side, throat, other = (
        KEYS.index(key) for key in ((0, 0), (5, 2), (1, 1), (1, 5), (3, 5))
    )
    assert least_held_s(mouth, side, throat) == pytest.approx(0.1)
    assert least_held_s(mouth, side, other) == least_held_s(side, throat, other) == 0.0
    assert 0.0 < least_held_s(rest, side, other) < least_held_s(rest, side, throat)
    assert least_held_s(side, rest, side) == 0.0
