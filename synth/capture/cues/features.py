"""Features of keys: the fingers in the hand's own frame, their tips in the head's.

Whatever the recording is, it comes as landmarks: those of an image tracker as they stand in the
picture, those of a voice's markers by the same map. Depth is not used: a single camera guesses it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.signal import savgol_filter

from codec.cuer import layout
from codec.cuer.models import rigid
from codec.cuer.voice import Voice
from synth.capture.sources.landmark_maps import FACE_LANDMARKS, WIDTH_LANDMARKS, face_map, hand_map

FloatArray = NDArray[np.float64]

N_FEATURES = 7
"""Reach of thumb and fingers, and how far they are spread."""

HEAD_MM = 153.0
"""Width of a head between the ears, to which all lengths are brought: the mean of MediaPipe's
canonical face."""

_BRIDGED_S = 0.14
"""Shorter gaps of the hand are bridged; trackers lose it for a few frames."""

_SMOOTHING_S = 0.1
"""Seconds over which speeds are smoothed."""

_LEAST_RUN_S = 0.2
"""Seconds that a hand must be seen at a stretch."""

_FINGERS_MM = 10.0
"""What one palm's length of fingers' movement counts against mm of the palm's, in
`HandFeatures.flow`: of 0 to 40 mm that which times the arrivals of three virtual cuers best (0.033
to 0.060 s off)."""

_STRAIGHT = 0.55, 0.08
"""Least extension of a finger whose own tip shows where it points, and the softness of that."""

_REACH = {8: (5, 1.0), 12: (9, 1.05)}
"""Tips of index and middle finger: their knuckle, and the length of the finger in palms."""

_PALM = [0, 5, 9, 13, 17]
"""Landmarks of the palm, as MediaPipe numbers them."""

_ACROSS = (5, 17)
"""Knuckles of index and little finger."""

_FINGERS = ((5, 8), (9, 12), (13, 16), (17, 20))
"""Numbers of knuckle and tip of each finger (MediaPipe)."""

_RIGID_FACE = layout.marker_indices(layout.RIGID_FACE)

_MOUTH = (61, 291)
"""Landmarks of the corners of the mouth."""

READ_HZ = 30.0
"""Frames per second at which keys are recognised, whatever a camera's: how likely a line of keys
is, and how many there are, depends on how finely time is divided. At 50 frames/s one key in ten was
too many, and keys that were right in .96 of cases had a confidence of .69."""

_PIECE = 4096
"""Frames that are looked at at once, for constant memory."""


@dataclass(frozen=True, slots=True)
class HandFeatures:
    """A hand over time, T frames; where it is not seen, NaN.

    Attributes
    ----------
    rate_hz : float
    fingers : ndarray of float64, shape (T, 7)
        How far index, middle, ring and little finger reach along the palm; the thumb's tip across
        and along it; the distance of index and middle finger's tips. In lengths of the palm.
    tips : ndarray of float64, shape (T, 2, 2)
        Index and middle finger against the resting mouth, x to the viewer's right and y up, for a
        head 153 mm wide.
    pointers : ndarray of float64, shape (T, 2, 2)
        Where the two fingers point, or would if they were straight.
    speed : ndarray of float64, shape (T,)
        Of the palm, mm/s.
    stance : ndarray of float64, shape (T, 2)
        Direction of the palm from the wrist, radians, 0 to the viewer's right, pi/2 up; and its
        width as it is seen, of its median: a palm that turns away is narrower.
    """

    rate_hz: float
    fingers: FloatArray
    tips: FloatArray
    pointers: FloatArray
    speed: FloatArray
    stance: FloatArray

    def __len__(self) -> int:
        return len(self.speed)

    @property
    def shown(self) -> NDArray[np.bool_]:
        """Frames that show the hand, shape (T,)."""
        return np.asarray(np.isfinite(self.speed))

    def flow(self) -> FloatArray:
        """Return how fast palm and fingers move together, mm/s, shape (T,); NaN if not seen.

        Keys that differ in shape alone are reached by fingers while the palm hardly moves.
        """
        if len(self) < 2:
            return self.speed
        fingers = np.gradient(self.fingers, 1.0 / self.rate_hz, axis=0)
        return np.asarray(np.hypot(self.speed, _FINGERS_MM * np.linalg.norm(fingers, axis=1)))

    def part(self, frames: slice) -> "HandFeatures":
        """Return some frames."""
        return HandFeatures(
            self.rate_hz,
            self.fingers[frames],
            self.tips[frames],
            self.pointers[frames],
            self.speed[frames],
            self.stance[frames],
        )

    def steady(self) -> "HandFeatures":
        """Return the features at `READ_HZ`, interpolated linearly."""
        if self.rate_hz == READ_HZ or not len(self):
            return self
        frames = np.arange(int((len(self) - 1) / self.rate_hz * READ_HZ + 1e-6) + 1)
        at = np.minimum(frames * (self.rate_hz / READ_HZ), len(self) - 1.0)
        before = at.astype(np.intp)
        after, part = np.minimum(before + 1, len(self) - 1), at - before

        def moved(x: FloatArray) -> FloatArray:
            share = part.reshape(-1, *[1] * (x.ndim - 1))
            # What is not seen is no part of a frame that it does not touch.
            mean = (1.0 - share) * x[before] + share * x[after]
            return np.asarray(np.where(share > 0.0, mean, x[before]))

        return HandFeatures(
            READ_HZ,
            moved(self.fingers),
            moved(self.tips),
            moved(self.pointers),
            moved(self.speed),
            moved(self.stance),
        )


def see(face: FloatArray, hand: FloatArray, *, rate_hz: float) -> HandFeatures:
    """Return the features of keys.

    Parameters
    ----------
    face : ndarray of float64, shape (T, L, 3)
        Landmarks `synth.capture.sources.landmark_maps.FACE_LANDMARKS`, mm, y up; NaN if not seen.
    hand : ndarray of float64, shape (T, 21, 3)
        Landmarks of the cueing hand in the same coordinates.
    rate_hz : float
    """
    points = _in_head(face, hand)
    shown = np.asarray(np.isfinite(points).all((1, 2)))
    out = HandFeatures(
        rate_hz,
        np.full((len(points), N_FEATURES), np.nan),
        np.full((len(points), 2, 2), np.nan),
        np.full((len(points), 2, 2), np.nan),
        np.full(len(points), np.nan),
        np.full((len(points), 2), np.nan),
    )
    window = max(5, 2 * round(0.5 * _SMOOTHING_S * rate_hz) + 1)
    # Per run of frames that show the hand; Savitzky-Golay needs a window's length at least.
    for run in _runs(shown, rate_hz):
        if run.stop - run.start < max(window, _LEAST_RUN_S * rate_hz):
            continue
        x = savgol_filter(_bridged(points[run], shown[run]), window, 2, axis=0, mode="nearest")
        out.fingers[run] = fingers_of(x)
        out.tips[run] = x[:, [8, 12]]
        out.pointers[run] = _pointers(x, out.fingers[run])
        # Speed of the palm in the head's frame.
        velocity = savgol_filter(
            x[:, _PALM].mean(1), window, 2, deriv=1, delta=1 / rate_hz, axis=0, mode="nearest"
        )
        out.speed[run] = np.linalg.norm(velocity, axis=1)
        # Stance: direction of the palm across the picture, and its apparent width, which shows its
        # turn; the width is relative to the film's median.
        palm = 0.5 * (x[:, 9] + x[:, 13]) - x[:, 0]
        out.stance[run, 0] = np.unwrap(np.arctan2(palm[:, 1], palm[:, 0]))
        out.stance[run, 1] = np.linalg.norm(x[:, _ACROSS[0]] - x[:, _ACROSS[1]], axis=1)
    if out.shown.any():
        out.stance[:, 1] /= max(float(np.nanmedian(out.stance[:, 1])), 1e-6)
    return out


def see_motion(voice: Voice, params: FloatArray, *, rate_hz: float) -> HandFeatures:
    """Return the features of keys from a voice's parameters, shape (T, P)."""
    faces, hands = [], []
    head = _resting_head(voice)
    for begin in range(0, len(params), _PIECE):
        markers = voice.reconstruct(params[begin : begin + _PIECE]).astype(np.float64)
        motion, _ = rigid.estimate_motion(head, markers[:, _RIGID_FACE])
        still = rigid.inverse_rigid_motion(markers, motion)
        faces.append(np.einsum("lk,tkc->tlc", face_map().weights, still[:, : layout.N_FACE]))
        hands.append(np.einsum("lk,tkc->tlc", hand_map().weights, still[:, layout.N_FACE :]))
    return see(np.concatenate(faces), np.concatenate(hands), rate_hz=rate_hz)


POINTS = (234, 454, *_MOUTH)
"""Landmarks of the face that `see_points` needs, besides the 21 of the hand."""


def points_of(face: FloatArray, hand: FloatArray) -> FloatArray:
    """Return what `see_points` needs of landmarks as `see` takes them, (..., 25, 2), mm."""
    slots = [FACE_LANDMARKS.index(number) for number in POINTS]
    return np.concatenate([face[..., slots, :2], hand[..., :2]], axis=-2)


def see_points(points: FloatArray, *, rate_hz: float) -> HandFeatures:
    """Return the features of keys from a few landmarks.

    Parameters
    ----------
    points : ndarray of float64, shape (T, 25, 2)
        Landmarks `POINTS` of the face and all of the hand, mm, y up; NaN where not seen.
    rate_hz : float
    """
    face = np.full((len(points), len(FACE_LANDMARKS), 2), np.nan)
    face[:, [FACE_LANDMARKS.index(number) for number in POINTS]] = points[:, : len(POINTS)]
    return see(face, points[:, len(POINTS) :], rate_hz=rate_hz)


def _resting_head(voice: Voice) -> FloatArray:
    row = np.zeros((1, len(voice.layout)))
    return np.asarray(voice.reconstruct(row)[0, _RIGID_FACE], dtype=np.float64)


def _in_head(face: FloatArray, hand: FloatArray) -> FloatArray:
    """Return the hand (T, 21, 2) against the mouth of a head that stands upright."""
    right, left = _ears(face)
    frames = np.arange(len(face))
    known = np.isfinite(right[:, 0] + left[:, 0])
    ends = np.concatenate([right, left], axis=1)
    ends = np.stack([np.interp(frames, frames[known], c[known]) for c in ends.T], axis=1)
    across, middle = ends[:, 2:] - ends[:, :2], 0.5 * (ends[:, 2:] + ends[:, :2])
    scale = HEAD_MM / float(np.quantile(np.linalg.norm(across, axis=1), 0.75))
    roll = np.arctan2(across[:, 1], across[:, 0])
    turn = np.array([[np.cos(roll), np.sin(roll)], [-np.sin(roll), np.cos(roll)]])
    corners = [FACE_LANDMARKS.index(number) for number in _MOUTH]
    mouth = np.einsum("ijt,tj->ti", turn, face[:, corners, :2].mean(1) - middle)
    rest = np.nanmedian(mouth, axis=0) if np.isfinite(mouth).any() else np.array([0.0, -70.0])
    still = np.einsum("ijt,tkj->tki", turn, hand[..., :2] - middle[:, None])
    return np.asarray(scale * (still - rest))


def _ears(face: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two landmarks (T, 2) of the face's sides, those that are seen most."""
    slots = [[FACE_LANDMARKS.index(number) for number in pair] for pair in WIDTH_LANDMARKS]
    shares = [np.isfinite(face[:, pair, 0]).all(1).mean() for pair in slots]
    best = slots[next(n for n, share in enumerate(shares) if share >= 0.9 * max(shares))]
    return face[:, best[0], :2], face[:, best[1], :2]


def fingers_of(x: FloatArray) -> FloatArray:
    """Return how far the fingers are out, as in `HandFeatures.fingers`, of a hand (T, 21, 2)."""
    palm = 0.5 * (x[:, 9] + x[:, 13]) - x[:, 0]
    length = np.maximum(np.linalg.norm(palm, axis=1, keepdims=True), 1e-6)
    along = palm / length
    across = x[:, 5] - x[:, 17]
    across = across - (across * along).sum(1, keepdims=True) * along
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-6)
    columns = [((x[:, tip] - x[:, knuckle]) * along).sum(1) for knuckle, tip in _FINGERS]
    columns.append(((x[:, 4] - x[:, 5]) * across).sum(1))
    columns.append(((x[:, 4] - x[:, 2]) * along).sum(1))
    columns.append(np.linalg.norm(x[:, 8] - x[:, 12], axis=1))
    return np.asarray(np.stack(columns, axis=1) / length)


def _pointers(x: FloatArray, fingers: FloatArray) -> FloatArray:
    palm = 0.5 * (x[:, 9] + x[:, 13]) - x[:, 0]
    out = np.empty((len(x), 2, 2))
    for number, (tip, (knuckle, reach)) in enumerate(_REACH.items()):
        straight = 1.0 / (1.0 + np.exp((_STRAIGHT[0] - fingers[:, number]) / _STRAIGHT[1]))
        would = x[:, knuckle] + reach * palm
        out[:, number] = would + straight[:, None] * (x[:, tip] - would)
    return out


def _runs(shown: NDArray[np.bool_], rate_hz: float) -> list[slice]:
    """Return the stretches that show the hand, short gaps within them included."""
    gaps, count = label(~shown)
    lasting = shown.copy()
    for number in range(1, count + 1):
        at = np.flatnonzero(gaps == number)
        inside = at[0] > 0 and at[-1] < len(shown) - 1
        if inside and len(at) <= _BRIDGED_S * rate_hz:
            lasting[at] = True
    stretches, count = label(lasting)
    found = (np.flatnonzero(stretches == number) for number in range(1, count + 1))
    return [slice(int(at[0]), int(at[-1]) + 1) for at in found]


def _bridged(points: FloatArray, shown: NDArray[np.bool_]) -> FloatArray:
    frames = np.arange(len(points))
    flat = points.reshape(len(points), -1)
    columns = [np.interp(frames, frames[shown], column[shown]) for column in flat.T]
    return np.stack(columns, axis=1).reshape(points.shape)
