"""Angles of every segment of the hand, measured from its markers.

Comes in: markers of the hand under a forearm at rest. Goes out: for every segment its rotation
(in the plane it bends in) and spread (out of that plane) against the forearm, the rotation
between successive phalanges, the twist of each finger, and rotation, twist and spread of palm and
wrist as rigid bodies. Step 2 of the hand model in Gibert, Bailly, Elisei 2004, section 3.2.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from codec.cuer import layout
from codec.cuer.models import rigid


def _columns(*names: str) -> NDArray[np.intp]:
    return np.array([layout.HAND_MARKERS.index(name) for name in names])


def _chains() -> tuple[tuple[str, ...], ...]:
    """Return the markers along each digit, from the palm to the nail."""
    return tuple(
        (*((f"P{digit}",) if digit > 1 else ()), f"K{digit}", *layout.FINGERS[digit - 1])
        for digit in range(1, 6)
    )


CHAINS = _chains()
SEGMENTS = tuple(pair for chain in CHAINS for pair in itertools.pairwise(chain))
"""Pairs of markers that bound the segments, digit by digit."""

_PROXIMAL = _columns(*(a for a, _ in SEGMENTS))
_DISTAL = _columns(*(b for _, b in SEGMENTS))
_SUCCESSIVE = np.array([i for i in range(1, len(SEGMENTS)) if SEGMENTS[i][0] == SEGMENTS[i - 1][1]])
# The side marker sits beside the middle phalange, on the thumb beside the first.
_SIDE_SEGMENT = np.array(
    [SEGMENTS.index(("F11", "F12")), *(SEGMENTS.index((f"F{d}2", f"F{d}3")) for d in range(2, 6))]
)
_SIDES = _columns(*layout.SIDES)
_PALM = _columns(*layout.PALM, *layout.KNUCKLES[1:])
_WRIST = _columns(*layout.WRIST)

N_ANGLES = 2 * len(SEGMENTS) + len(_SUCCESSIVE) + len(_SIDES) + 6
"""Angles of a hand: two per segment, those between neighbours, and six of the wrist."""


@dataclass(frozen=True, slots=True)
class AngleFrames:
    """Reference directions against which the angles of one cuer are measured.

    Attributes
    ----------
    axes : ndarray of float64, shape (S, 3, 3)
        Per segment: middle direction, direction it bends towards, hinge.
    palm, wrist : ndarray of float64, shape (8, 3), (4, 3)
        Mean positions of the markers of palm and wrist, millimetres.
    twist : ndarray of float64, shape (5,)
        Mean direction of each side marker around its segment, radians.
    """

    axes: NDArray[np.float64]
    palm: NDArray[np.float64]
    wrist: NDArray[np.float64]
    twist: NDArray[np.float64]


def angle_frames(points: NDArray[np.float64]) -> AngleFrames:
    """Learn the reference directions from frames of a moving hand.

    The hinge of a segment is the direction of least variance of its unit vectors.

    Parameters
    ----------
    points : ndarray of float64, shape (T, 50, 3)
        Forearm at rest, millimetres.
    """
    unit = _directions(points)
    middle = unit.mean(0)
    middle /= np.maximum(np.linalg.norm(middle, axis=-1, keepdims=True), 1e-9)
    moments = np.einsum("tsi,tsj->sij", unit, unit) / len(points)
    hinge = np.linalg.eigh(moments)[1][:, :, 0]
    hinge -= (hinge * middle).sum(-1, keepdims=True) * middle
    hinge /= np.maximum(np.linalg.norm(hinge, axis=-1, keepdims=True), 1e-9)
    axes = np.stack([middle, np.cross(hinge, middle), hinge], axis=1)
    sine, cosine = _side_components(points, unit, axes)
    twist = np.arctan2(sine.mean(0), cosine.mean(0))
    return AngleFrames(axes, points[:, _PALM].mean(0), points[:, _WRIST].mean(0), twist)


def measure_angles(points: NDArray[np.float64], frames: AngleFrames) -> NDArray[np.float64]:
    """Return all angles of each frame.

    Parameters
    ----------
    points : ndarray of float64, shape (T, 50, 3)
        Forearm at rest, millimetres; every marker known.
    frames : AngleFrames

    Returns
    -------
    ndarray of float64, shape (T, N_ANGLES)
        Radians: rotations of the segments, their spreads, rotations between successive segments,
        twists of the digits, then the rotation vectors of palm and wrist.
    """
    unit = _directions(points)
    local = np.einsum("tsi,sai->tsa", unit, frames.axes)
    rotation = np.arctan2(local[..., 1], local[..., 0])
    spread = np.arcsin(np.clip(local[..., 2], -1, 1))
    sine, cosine = _side_components(points, unit, frames.axes)
    twist = _wrapped(np.arctan2(sine, cosine) - frames.twist)
    palm, _ = rigid.estimate_motion(frames.palm, points[:, _PALM])
    wrist, _ = rigid.estimate_motion(frames.wrist, points[:, _WRIST])
    successive = _bends(unit, frames.axes)
    return np.concatenate([rotation, spread, successive, twist, palm[:, :3], wrist[:, :3]], axis=1)


def _directions(points: NDArray[np.float64]) -> NDArray[np.float64]:
    chords = points[:, _DISTAL] - points[:, _PROXIMAL]
    length = np.linalg.norm(chords, axis=-1, keepdims=True)
    return np.asarray(chords / np.maximum(length, 1e-9))


def _bends(unit: NDArray[np.float64], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed angle from each segment to the next about the next one's hinge."""
    before, after = unit[:, _SUCCESSIVE - 1], unit[:, _SUCCESSIVE]
    sine = (np.cross(before, after) * axes[_SUCCESSIVE, 2]).sum(-1)
    return np.asarray(np.arctan2(sine, (before * after).sum(-1)))


def _side_components(
    points: NDArray[np.float64], unit: NDArray[np.float64], axes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return sine and cosine (to a common factor) of the side markers around their segments."""
    along = unit[:, _SIDE_SEGMENT]
    side = points[:, _SIDES] - points[:, _PROXIMAL[_SIDE_SEGMENT]]
    hinge = axes[_SIDE_SEGMENT, 2]
    across = np.cross(along, hinge)
    return (side * across).sum(-1), (side * np.cross(across, along)).sum(-1)


def _wrapped(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)
