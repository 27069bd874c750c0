"""What the cuer's face and trunk do beside the parameters on air: lids, gaze, brows, head, breath.

Parameters of the last seconds go in, weights of blend shapes, gaze, the head's additional turn and
the trunk's shift come out. Everything is a function of the programme's time and of the parameters
within `RULES` ``taps * step_s`` before it: a receiver that tuned in earlier than that draws the
same. The page computes it from the same table (``page/movement.js``), which travels with the voice.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import MARKERS, N_FACE, THROAT
from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENTS

FloatArray = NDArray[np.float64]
Sampler = Callable[[FloatArray], NDArray[np.floating[Any]]]
"""From times (n,), seconds, to parameters (n, P)."""

RULES: dict[str, Any] = {
    # Memory: `taps` samples, `step_s` apart, weighted by exponentials of these times (s).
    "step_s": 0.04, "taps": 64, "hand_s": [0.25, 1.3], "mouth_s": [0.09, 0.5],
    # 11 blinks a minute at rest, 19 over the demonstration; people 8 to 21 looking ahead and 10 to
    # 32 in conversation (Doughty 2001, Optom. Vis. Sci. 78), means 17 and 26 (Bentivoglio et al.
    # 1997, Mov. Disord. 12).
    # Blinks: closing, closed and opening (s); how long after the hand sinks; slots of chance (s):
    # a slot blinks if its number drawn is the largest of five.
    "blink_s": [0.08, 0.03, 0.17], "blink_after_s": 0.16, "blink_slot_s": 1.05,
    # Fixations of the eyes: slot and jump (s); half width (rad) while she cues, and at rest.
    "fixation_s": 1.3, "saccade_s": 0.06, "wander_rad": [[0.012, 0.006], [0.05, 0.025]],
    "lens_rad": [-0.02, -0.055], "lids_per_rad": 1.6, "lids_rest": 0.18,
    # Nods and waves: .8 degrees rms an axis, 5 degrees from end to end, as much as the parameters'
    # own; no published angle of nods in French speech was found.
    # Head: radians per mm of the mouth's opening beyond its mean; at a phrase's onset and end.
    "nod": {"per_mm": 0.0042, "onset": -0.075, "end": 0.085, "most_rad": 0.07},
    # Waves of head (rad) and trunk (mm), per axis: size, period (s), phase (turns).
    # Measured on 64 takes of a real cuer: within a take her head spans (5 to 95 %) 1.7 degrees of
    # roll, .034 of its width sideways, .035 up and down; with these waves 1.8, .035, .030
    # (tests/bench/head_motion.py).
    "head_waves": [
        [[0.010, 5.3, 0.1], [0.006, 2.3, 0.7]], [[0.020, 7.1, 0.4], [0.010, 3.1, 0.2]],
        [[0.010, 9.7, 0.8], [0.006, 3.7, 0.5]],
    ],
    "trunk_waves": [
        [[2.6, 11.3, 0.3], [1.2, 5.9, 0.6]], [[0.6, 8.3, 0.2]], [[1.8, 9.1, 0.9], [0.8, 4.3, 0.1]],
    ],
    "resting_share": 0.55, "neck_mm": [0.0, -62.0, 8.0],
    # Trunk: shift (mm) of the face for a raised hand and for a full breath; the figure leans by it
    # about the lower back, so far (mm) below the middle of the head.
    "trunk_raised_mm": [2.5, 0.0, 1.5], "trunk_breath_mm": [0.0, 1.6, 0.4], "lean_mm": 500.0,
    # Breath: at rest, in at the onset of a phrase, wave of rest: size, period (s), phase.
    "breath": [0.42, 0.75], "breath_wave": [0.3, 4.1, 0.0],
    # Brows and cheeks: onset, accent per mm, knitting wave (size, period, phase).
    "brow_onset": 0.4, "brow_per_mm": 0.04, "knit_wave": [0.2, 6.7, 0.35],
    "squint": [0.08, 0.5], "cheek_per_mm": 0.035, "wide_onset": 0.1,
    # Arm: share by which the shoulder follows the elbow per axis, and at most (mm); breath's lift.
    "shoulder": [0.12, 0.25, 0.22], "shoulder_most_mm": 26.0, "shoulder_breath_mm": 3.5,
}  # fmt: skip
"""The one table of the rules; all times are seconds, all angles radians."""

_LOW_ROWS = 3
"""Rows of throat markers that a hand can point at; those above lie under the chin."""

_SHAPES_OF_A_BLINK = ("eyeBlinkLeft", "eyeBlinkRight")
_TOP_LIP, _LOW_LIP = MARKERS.index("UL0"), MARKERS.index("LL0")


@dataclass(frozen=True, slots=True)
class Expression:
    """What the rules add to the parameters at T moments.

    Attributes
    ----------
    shapes : dict of str to ndarray, shape (T,)
        Weights of blend shapes, 0..1.
    gaze : ndarray, shape (T, 2)
        Radians from straight ahead of a head at rest: to the viewer's right, and up.
    nod : ndarray, shape (T, 3)
        Rotation vector, radians, added to the head's turn.
    trunk : ndarray, shape (T, 3)
        Shift of the face as the figure leans, mm.
    breath : ndarray, shape (T,)
    """

    shapes: dict[str, FloatArray]
    gaze: FloatArray
    nod: FloatArray
    trunk: FloatArray
    breath: FloatArray


def lean(places: FloatArray, trunk: FloatArray, head: NDArray[np.floating[Any]]) -> None:
    """Lean the figure about the lower back, in place; angles are small enough to be linear.

    Parameters
    ----------
    places : ndarray, shape (T, V, 3)
        Of the figure, mm.
    trunk : ndarray, shape (T, 3)
        Of `Expression`.
    head : ndarray, shape (3,)
        Middle of the head, mm.
    """
    far = RULES["lean_mm"]
    side, up, front = (trunk[:, k, None] for k in range(3))
    x, height, z = (places[..., k] - head[k] for k in range(3))
    height = 1 + height / far
    places[..., 1] += up - (side * x + front * z) / far
    places[..., 0] += side * height
    places[..., 2] += front * height


def signals(voice: Voice) -> FloatArray:
    """Return the two signals that the rules follow, shape (2, 1 + P): constant, factors.

    How far the hand is raised, 0 at rest and 1 where cueing begins; how far the mouth is open
    against the voice's mean, mm.
    """
    found = np.zeros((2, 1 + len(voice.layout)))
    columns = voice.hand_columns[voice.hand.n_shape :]
    found[0, 0] = voice.hand.motion_mean[4]
    found[0, 1 + np.asarray(columns)] = voice.hand.motion_directions[:, 4]
    targets = voice.gestures.placement_targets
    heights = found[0, 0] + targets @ found[0, 1 + np.asarray(columns)]
    rest = heights[0, PLACEMENTS.index("rest")]
    lowest = min(heights[1:, k].min() for k, name in enumerate(PLACEMENTS) if name != "rest")
    found[0, 0] -= rest
    found[0] /= lowest - rest
    directions = voice.face.directions.reshape(-1, N_FACE, 3)
    gap = directions[:, _TOP_LIP, 1] - directions[:, _LOW_LIP, 1]
    found[1, 1 + np.asarray(voice.face_columns[: len(gap)])] = gap
    return found


def throat_shares(voice: Voice) -> FloatArray:
    """Return height, share of the head's turn and of its shift down the throat, shape (N, 3)."""
    rows = [MARKERS.index(name) for name in THROAT if name.endswith("C")][-_LOW_ROWS:]
    heights, weights = voice.face.mean[rows, 1], voice.face.weights[rows]
    found = np.column_stack([heights, weights[:, :3].mean(axis=1), weights[:, 3:].mean(axis=1)])
    top, bottom = [heights[0] + 15.0, 1.0, 1.0], [heights[-1] - 40.0, 0.0, 0.0]
    return np.array([bottom, *found[::-1].astype(np.float64), top])


def chance(numbers: NDArray[np.int64]) -> FloatArray:
    """Return evenly spread numbers, 0..1, that whole `numbers` always give.

    Examples
    --------
    >>> chance(np.array([0, 1, -1])).round(6).tolist()
    [0.0, 0.526657, 0.600432]
    """
    x = np.asarray(numbers, dtype=np.int64) & 0xFFFFFFFF
    x = (x ^ (x >> 16)) * 0x21F0AAAD & 0xFFFFFFFF
    x = (x ^ (x >> 15)) * 0x735A2D97 & 0xFFFFFFFF
    return np.asarray((x ^ (x >> 15)) / 4294967296)


def express(voice: Voice, sample: Sampler, times_s: FloatArray) -> Expression:
    """Return what the rules add at times on the programme's clock.

    Parameters
    ----------
    voice : Voice
    sample : callable
        Parameters at any times; before the first known ones those are held.
    times_s : ndarray, shape (T,)
    """
    t = np.asarray(times_s, dtype=np.float64)
    ago = RULES["step_s"] * np.arange(RULES["taps"])
    params = np.asarray(sample((t[:, None] - ago).ravel()), dtype=np.float64)
    linear = signals(voice)
    found = (params @ linear[:, 1:].T + linear[:, 0]).reshape(len(t), len(ago), 2)
    raised = _smooth(found[..., 0])
    cueing, lately = (_memory(raised, ago, tau) for tau in RULES["hand_s"])
    onset, end = np.maximum(cueing - lately, 0), np.maximum(lately - cueing, 0)
    near, mean = (_memory(found[..., 1], ago, tau) for tau in RULES["mouth_s"])
    accent = near - mean
    nod = _nod(t, accent, onset, end, lately)
    size, period, phase = RULES["breath_wave"]
    wave = size * (1 - lately) * np.sin(2 * np.pi * (t / period + phase))
    breath = np.clip(RULES["breath"][0] + RULES["breath"][1] * onset + wave, 0, 1)
    gaze = _fixation(t, lately) + RULES["lens_rad"]
    shapes = _face(t, raised, accent, onset, lately)
    shapes["breath"] = breath
    return Expression(shapes, gaze, nod, _trunk(t, lately, breath), breath)


def _smooth(x: FloatArray) -> FloatArray:
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def _memory(x: FloatArray, ago: FloatArray, tau: float) -> FloatArray:
    """Return means of x (T, N) that forget with a time constant, shape (T,)."""
    weights = np.exp(-ago / tau)
    return np.asarray(x @ (weights / weights.sum()))


def _waves(t: FloatArray, waves: list[list[float]]) -> FloatArray:
    return np.asarray(sum(a * np.sin(2 * np.pi * (t / p + phase)) for a, p, phase in waves))


def _nod(
    t: FloatArray, accent: FloatArray, onset: FloatArray, end: FloatArray, lately: FloatArray
) -> FloatArray:
    rule, rest = RULES["nod"], RULES["resting_share"]
    share = rest + (1 - rest) * lately
    turn = np.stack([share * _waves(t, waves) for waves in RULES["head_waves"]], axis=1)
    turn[:, 0] += rule["per_mm"] * accent + rule["onset"] * onset + rule["end"] * end
    most = rule["most_rad"]
    return np.asarray(most * np.tanh(turn / most))


def _trunk(t: FloatArray, lately: FloatArray, breath: FloatArray) -> FloatArray:
    return np.stack(
        [
            _waves(t, RULES["trunk_waves"][k])
            + RULES["trunk_raised_mm"][k] * lately
            + RULES["trunk_breath_mm"][k] * breath
            for k in range(3)
        ],
        axis=1,
    )


def _fixation(t: FloatArray, lately: FloatArray) -> FloatArray:
    """Return the eyes' offset from the lens, shape (T, 2): still, then a jump, then still."""
    slot = RULES["fixation_s"]
    at = t / slot
    number = np.floor(at).astype(np.int64)
    late = slot * (at - number) - 0.5 * slot * chance(3 * number)
    jumped = _smooth(late / RULES["saccade_s"])[:, None]

    def place(n: NDArray[np.int64]) -> FloatArray:
        both = np.stack([chance(3 * n + 1), chance(3 * n + 2)], axis=1)
        return np.asarray((2 * both - 1) ** 3)

    still = (1 - jumped) * place(number - 1) + jumped * place(number)
    cueing, resting = np.array(RULES["wander_rad"])
    return np.asarray(still * (resting + lately[:, None] * (cueing - resting)))


def _lids(u: FloatArray) -> FloatArray:
    """Return how far lids are closed `u` seconds after a blink began."""
    closing, closed, opening = RULES["blink_s"]
    return np.minimum(_smooth(u / closing), _smooth((closing + closed + opening - u) / opening))


def _blink(t: FloatArray, raised: FloatArray) -> FloatArray:
    """Return how far the lids are closed, 0..1: by chance, and where the hand sinks."""
    slot = RULES["blink_slot_s"]
    number = np.floor(t / slot).astype(np.int64)
    shut = np.zeros(len(t))
    for n in (number - 1, number):
        drawn = chance(7 * n)
        others = np.max([chance(7 * (n + k)) for k in (-2, -1, 1, 2)], axis=0)
        begins = slot * (n + 0.8 * chance(7 * n + 1))
        shut = np.maximum(shut, (drawn > others) * _lids(t - begins))
    sinks = (raised[:, :-1] < 0.5) & (raised[:, 1:] >= 0.5)
    first = sinks.argmax(axis=1)
    row = np.arange(len(t))
    now, before = raised[row, first], raised[row, first + 1]
    ago = RULES["step_s"] * (first + (0.5 - now) / np.where(before > now, before - now, 1))
    sunk = sinks.any(axis=1) * _lids(ago - RULES["blink_after_s"])
    return np.asarray(np.maximum(shut, sunk))


def _face(
    t: FloatArray, raised: FloatArray, accent: FloatArray, onset: FloatArray, lately: FloatArray
) -> dict[str, FloatArray]:
    """Return the weights of brows, lids and cheeks."""
    size, period, phase = RULES["knit_wave"]
    knit = np.maximum(size * np.sin(2 * np.pi * (t / period + phase)), 0) * lately
    # Brows rise at accents and onsets; knitting them takes from that.
    raise_ = np.clip(
        RULES["brow_onset"] * onset + RULES["brow_per_mm"] * np.maximum(accent, 0) - 0.3 * knit,
        0,
        1,
    )
    shut = _blink(t, raised)
    squint = np.clip(RULES["squint"][0] + RULES["squint"][1] * knit, 0, 1)
    cheek = np.clip(RULES["cheek_per_mm"] * np.maximum(-accent, 0) + 0.3 * knit, 0, 1)
    wide = np.clip(RULES["wide_onset"] * onset, 0, 1) * (1 - shut)
    open_ = RULES["lids_rest"]
    found = dict.fromkeys(_SHAPES_OF_A_BLINK, open_ + (1 - open_) * shut)
    for side in ("Left", "Right"):
        found |= {
            f"browOuterUp{side}": raise_,
            f"browDown{side}": knit,
            f"eyeSquint{side}": squint * (1 - shut),
            f"cheekSquint{side}": cheek,
            f"eyeWide{side}": wide,
        }
    return found | {"browInnerUp": 0.6 * raise_}


def movement_document(voice: Voice) -> dict[str, Any]:
    """Return the table for the page: `RULES`, the voice's signals and its throat."""
    return RULES | {"signals": signals(voice).tolist(), "throat": throat_shares(voice).tolist()}
