"""A score for recognised keys: phones with the hand's keys, chosen by the lips.

A key leaves open which of its consonants and which of its vowels was spoken; that is what lips are
for. Each key takes the phones whose visemes the face comes closest to. Times follow from the hand:
it arrives in the first part of a key's consonant (Attina 2005), or at the start of a sound that
has the key alone (Gibert, Bailly, Elisei 2004, section 5.1).
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, NO_CONSONANT_SHAPE, NO_VOWEL_PLACEMENT, SHAPE_OF
from codec.cues.phonology import PHONE_NUMBER, VOWELS
from codec.cues.score import PLACEMENTS, Key, Phone, Score
from synth.capture.cues.recognise import HeldKey

FloatArray = NDArray[np.float64]

_LAG_S = 0.033
"""Seconds from the start of a consonant with a vowel to the hand's arrival: mean of four cuers
(Attina 2005: 0.037, 0.017, 0.029 and 0.049 s)."""

_TO_REST_DELAY_S = 0.08
"""Seconds after a key's end at which the hand sets out for rest (P3)."""

_LEAST_KEY_S = 0.06
"""Shortest key in seconds."""

_LONGEST_KEY_S = 0.6
"""Longest key in seconds; a hand that stays longer pauses."""

_CONSONANT_PART, _LONGEST_CONSONANT_S = 0.4, 0.14
"""Part of a key that its consonant takes, and the seconds of it at most."""

_LIPS_MM = 1.5
"""Spread in mm of the lips about a phone's target."""

_ALONE = 1.0
"""Cost of a key of one phone: they are rarer than keys of two."""

_UNSURE = 0.5
"""Least confidence of a key that the report counts as recognised."""

LEAST_SURE = 0.6
"""Share of keys that have to be sure for a score to help more than it misleads."""


def score_of(
    held: Sequence[HeldKey],
    voice: Voice,
    params: FloatArray,
    *,
    rate_hz: float,
    start_s: float,
    given: Sequence[tuple[str, ...]] | None = None,
) -> Score:
    """Return phones and keys for the keys that the hand held.

    Parameters
    ----------
    held : sequence of HeldKey
        From `synth.capture.cues.recognise.recognise_keys` on the same parameters.
    voice : Voice
    params : ndarray, shape (T, P)
    rate_hz, start_s : float
        Clock of the frames.
    given : sequence of tuple of str, optional
        The phones of each key that is not rest, if they are known.
    """
    if given is None:
        given = _phones_shown(held, voice, params, rate_hz)
    phones: list[Phone] = []
    keys: list[Key] = []
    keyed = [h for h in held if h.shape]
    spans = _spans(held, [_LAG_S if len(own) > 1 else 0.0 for own in given])
    for one, own, (begin, end) in zip(keyed, given, spans, strict=True):
        cuts = (begin, _vowel_start(begin, end), end) if len(own) == 2 else (begin, end)
        for symbol, a, b in zip(own, cuts[:-1], cuts[1:], strict=True):
            phones.append(Phone(symbol, start_s + a, start_s + b))
        place = PLACEMENTS[one.placement]
        keys.append(Key(start_s + begin, start_s + end, tuple(own), one.shape, place))
    return Score(tuple(phones), tuple(keys))


_AS_SHOWN = {
    ("ə", "cheek"): "ø",
    ("œ", "cheek"): "ø",
    ("ø", "side"): "œ",
    ("œ̃", "cheek"): "ɛ̃",
    ("ɔ", "side"): "o",
    ("o", "chin"): "ɔ",
}
"""A vowel that was cued elsewhere than the chart says is that of the place where it was."""


def score_of_text(
    held: Sequence[HeldKey | None],
    keys: Sequence[Key],
    voice: Voice,
    params: FloatArray,
    *,
    rate_hz: float,
    start_s: float,
) -> Score:
    """Return phones and keys of a text at the times when the hand held them.

    Parameters
    ----------
    held : sequence of HeldKey or None
        For each of `keys`; omitted ones are not in the score.
    keys : sequence of Key
        Of the text.
    voice, params, rate_hz, start_s
        As for `score_of`.
    """
    shown = [(one, key.phones) for one, key in zip(held, keys, strict=True) if one is not None]
    given = [
        tuple(_AS_SHOWN.get((p, PLACEMENTS[one.placement]), p) for p in phones)
        for one, phones in shown
    ]
    return score_of(
        [one for one, _ in shown], voice, params, rate_hz=rate_hz, start_s=start_s, given=given
    )


def is_sure(held: Sequence[HeldKey]) -> bool:
    """Return whether enough of the keys are sure."""
    keys = [one.confidence > _UNSURE for one in held if one.shape]
    return bool(keys) and sum(keys) >= LEAST_SURE * len(keys)


def _phones_shown(
    held: Sequence[HeldKey], voice: Voice, params: FloatArray, rate_hz: float
) -> list[tuple[str, ...]]:
    """Return the phones of each key that is not rest, as the face shows them."""
    face = params[:, voice.face_columns[: voice.gestures.viseme_targets.shape[1]]]
    costs = _Visemes(voice, face, rate_hz)
    keyed = [h for h in held if h.shape]
    out: list[tuple[str, ...]] = []
    lonely_until = -1.0
    for one, (begin, end) in zip(keyed, _spans(held, [_LAG_S] * len(keyed)), strict=True):
        joined = abs(lonely_until - begin) < 1e-6
        middle = _vowel_start(begin, end)
        out.append(_chosen(one, costs, begin, middle, end, after_consonant=joined))
        lonely_until = end if out[-1][-1] in SHAPE_OF else -1.0
    return out


def _vowel_start(begin: float, end: float) -> float:
    return begin + min(_CONSONANT_PART * (end - begin), _LONGEST_CONSONANT_S)


def _spans(held: Sequence[HeldKey], lags: Sequence[float]) -> list[tuple[float, float]]:
    """Return start and end of each key's sound, seconds from the first frame.

    `lags` are the seconds from that start to the hand's arrival, of each key that is not rest.
    """
    spans: list[tuple[float, float]] = []
    for number, one in enumerate(held):
        if not one.shape:
            continue
        begin = max(one.reach_s - lags[len(spans)], 0.0)
        if spans:
            begin = max(begin, spans[-1][0] + _LEAST_KEY_S)
            spans[-1] = (spans[-1][0], min(spans[-1][1], begin))
        after = held[number + 1] if number + 1 < len(held) else None
        if after is None or not after.shape:
            end = one.leave_s - _TO_REST_DELAY_S
        else:
            # A hand that waits in the air says nothing; but a longer silence would mean rest.
            silent = DEFAULT_OPTIONS.rest_gap_s - _LEAST_KEY_S
            following = after.reach_s - lags[len(spans) + 1]
            end = following
            if following - begin > _LONGEST_KEY_S:
                end = max(begin + _LONGEST_KEY_S, following - silent)
        spans.append((begin, max(end, begin + _LEAST_KEY_S)))
    return spans


class _Visemes:
    """How far the face is from each phone's viseme over some time, in squared deviations."""

    def __init__(self, voice: Voice, face: FloatArray, rate_hz: float) -> None:
        weight = np.square(voice.face.directions.astype(np.float64)).sum(-1).mean(1)
        gap = face[:, None] - voice.gestures.viseme_targets[None].astype(np.float64)
        squares = (gap**2 @ weight) / _LIPS_MM**2
        self._sums = np.concatenate([np.zeros((1, squares.shape[1])), squares.cumsum(0)])
        self._rate_hz = rate_hz

    def cost(self, symbol: str, begin: float, end: float) -> float:
        """Return the mean cost of a phone between two times."""
        last = len(self._sums) - 1
        a = int(np.clip(round(begin * self._rate_hz), 0, last - 1))
        b = int(np.clip(round(end * self._rate_hz), a + 1, last))
        column = PHONE_NUMBER[symbol]
        return float(self._sums[b, column] - self._sums[a, column]) / (b - a)


def _chosen(
    one: HeldKey,
    visemes: _Visemes,
    begin: float,
    middle: float,
    end: float,
    *,
    after_consonant: bool,
) -> tuple[str, ...]:
    """Return the one or two phones of a key that the face shows best."""
    place = PLACEMENTS[one.placement]
    consonants = [c for c, shape in SHAPE_OF.items() if shape == one.shape]
    vowels = [v for v in VOWELS if DEFAULT_OPTIONS.placement(v) == place]
    # Both halves count alike, however long they are.
    first = {c: visemes.cost(c, begin, middle) for c in consonants}
    second = {v: visemes.cost(v, middle, end) for v in vowels}
    choices: list[tuple[float, tuple[str, ...]]] = [
        (first[c] + second[v], (c, v)) for c in consonants for v in vowels
    ]
    if place == NO_VOWEL_PLACEMENT:
        choices += [(2 * visemes.cost(c, begin, end) + _ALONE, (c,)) for c in consonants]
    # A vowel directly after a lone consonant would share the consonant's key.
    if one.shape == NO_CONSONANT_SHAPE and not after_consonant:
        choices += [(2 * visemes.cost(v, begin, end) + _ALONE, (v,)) for v in vowels]
    return min(choices)[1]
