"""A motion-capture studio: what its cameras make of the true markers.

Twelve cameras stand on an arc before the cuer, or around her hand for the first corpus. A marker
is seen if at least two of them look at its skin at less than 75 degrees from the normal and
neither head, neck, hand nor forearm is in the way; so gaps grow exactly when the hand is at the
face. Visible markers carry white noise and a smooth error of calibration. Drop-outs, swapped
neighbours and ghost points are options for tests of what reads such files.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from synth.motion.body.body import Body, BodyPose
from synth.studio import _kernels

FloatArray = NDArray[np.float64]

_RADIUS_MM = 2300.0
"""Distance in mm of the cameras from the head."""

_HEAD_ELLIPSOIDS = (
    ((0.0, 45.0, 4.0), (73.0, 84.0, 98.0)),
    ((0.0, -38.0, 44.0), (60.0, 58.0, 56.0)),
    ((0.0, -8.0, 96.0), (10.0, 20.0, 13.0)),
)
"""Centre and radii, mm, of skull, lower face and nose of the mesh at scale 1."""

_NECK = ((0.0, -165.0, -12.0), (0.0, -50.0, -8.0), 50.0)
"""Ends and radius in mm of the neck, which hides markers behind it."""

_INSIDE = 0.93
"""Share of a limb's radius that hides: markers on its own skin are not hidden by it."""

_WAVES = 6
"""Waves in space that soft tissue's push is made of."""

_WAVELENGTH_MM = (350.0, 1200.0)
"""Wavelengths in mm between which they are drawn."""


def _ring(azimuth_deg: FloatArray, height_deg: FloatArray) -> FloatArray:
    """Return camera positions (N, 3), mm, in all directions of the two grids."""
    azimuth, height = np.meshgrid(np.radians(azimuth_deg), np.radians(height_deg))
    x, y = np.sin(azimuth) * np.cos(height), np.sin(height)
    z = np.cos(azimuth) * np.cos(height)
    return _RADIUS_MM * np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)


def front_arc() -> FloatArray:
    """Return twelve positions before the cuer, two rows of six, mm: for face and sentences."""
    return _ring(np.linspace(-66.0, 66.0, 6), np.array([-32.0, 20.0]))


def surround() -> FloatArray:
    """Return twelve positions all around, mm: for the hand alone in free space."""
    return np.concatenate(
        [
            _ring(np.arange(0.0, 360.0, 60.0), np.array([-32.0])),
            _ring(np.arange(30.0, 390.0, 60.0), np.array([32.0])),
        ]
    )


@dataclass(frozen=True, slots=True)
class Studio:
    """Cameras and their faults.

    Attributes
    ----------
    cameras : ndarray, shape (C, 3)
        Positions, mm, in the cuer's coordinates.
    least_cameras : int
        How many have to see a marker.
    widest_angle_deg : float
        Between the skin's normal and the line of sight.
    noise_mm : float
        Standard deviation of the white noise per axis.
    bias_mm : float
        Standard deviation of the smooth error of calibration per axis.
    dropouts_per_s : float
        Losses of one marker for 1 to 5 frames, per marker.
    swaps_per_s : float
        Exchanges of two neighbours for 2 to 20 frames, in all.
    ghosts_per_s : float
        Points that are no marker, for 1 to 10 frames, in all.
    """

    cameras: FloatArray = field(default_factory=front_arc)
    least_cameras: int = 2
    widest_angle_deg: float = 75.0
    noise_mm: float = 0.2
    bias_mm: float = 0.3
    dropouts_per_s: float = 0.02
    swaps_per_s: float = 0.0
    ghosts_per_s: float = 0.0

    def __post_init__(self) -> None:
        if self.cameras.ndim != 2 or self.cameras.shape[1] != 3:
            raise CueError(f"cameras have shape {self.cameras.shape}, expected (C, 3)")
        if not 1 <= self.least_cameras <= len(self.cameras):
            raise CueError(
                f"{self.least_cameras} cameras have to see a marker, there are {len(self.cameras)}"
            )

    def seen(self, body: Body, pose: BodyPose, markers: FloatArray) -> NDArray[np.bool_]:
        """Return which markers (T, 113, 3) enough cameras see, shape (T, 113)."""
        rods, radius = _rods(body, pose)
        centre, to_sphere = _head(body, pose)
        count = np.zeros(markers.shape[:2], dtype=np.int64)
        _kernels.count_cameras(
            np.ascontiguousarray(markers, dtype=np.float64),
            np.ascontiguousarray(body.normals(pose)), self.cameras,
            float(np.cos(np.radians(self.widest_angle_deg))), self.least_cameras,
            *rods, radius, centre, to_sphere, count,
        )  # fmt: skip
        return count >= self.least_cameras

    def observe(
        self, markers: FloatArray, seen: NDArray[np.bool_], rate_hz: float, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the studio's measurements.

        Parameters
        ----------
        markers : ndarray, shape (T, 113, 3)
            The truth, mm.
        seen : ndarray of bool, shape (T, 113)
        rate_hz : float
        rng : numpy.random.Generator
            Of all faults; the same generator state gives the same recording.

        Returns
        -------
        observed : ndarray of float32, shape (T, 113, 3)
            NaN where hidden.
        ghosts : ndarray of float32, shape (T, G, 3)
            Points that are no marker; mostly NaN.
        """
        observed = np.array(markers, dtype=np.float64)
        observed += _calibration(observed, self.bias_mm, rng)
        observed += rng.normal(scale=self.noise_mm, size=observed.shape)
        observed[~(seen & ~_dropouts(seen.shape, self.dropouts_per_s / rate_hz, rng))] = np.nan
        _swap(observed, markers, self.swaps_per_s / rate_hz, rng)
        ghosts = _ghosts(observed, self.ghosts_per_s / rate_hz, rng)
        return observed.astype(np.float32), ghosts


def _rods(body: Body, pose: BodyPose) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Return start, end (T, 23, 3) and radius (23,) of hand, forearm and neck."""
    turns, start = body.arm_bones(pose.angles, pose.forearm)
    end = start + turns[..., 1] * body.arm_lengths[:, None]
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    low, high = (np.tile(np.array(point) * scale, (len(pose), 1, 1)) for point in _NECK[:2])
    radius = np.append(_INSIDE * body.arm_radii, _NECK[2] * scale[0])
    return (np.concatenate([start, low], axis=1), np.concatenate([end, high], axis=1)), radius


def _head(body: Body, pose: BodyPose) -> tuple[FloatArray, FloatArray]:
    """Return centres (T, 3, 3) and unit-sphere maps (T, 3, 3, 3) of the head's ellipsoids."""
    scale = np.array(body.anatomy.face) * body.anatomy.scale
    turns, places = body.neck(pose.head)
    joint = body.face_skin.origins[-1]
    centres, maps = [], []
    for centre, radii in _HEAD_ELLIPSOIDS:
        centres.append(places[:, -1] + turns[:, -1] @ (np.array(centre) * scale - joint))
        inverse = 1.0 / (_INSIDE * np.array(radii) * scale)
        maps.append(inverse[:, None] * turns[:, -1].transpose(0, 2, 1))
    return np.stack(centres, axis=1), np.ascontiguousarray(np.stack(maps, axis=1))


def _calibration(points: FloatArray, size_mm: float, rng: np.random.Generator) -> FloatArray:
    """Return a smooth error field at `points` (..., 3): a few long waves in space."""
    direction = rng.normal(size=(_WAVES, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    number = 2 * np.pi / rng.uniform(*_WAVELENGTH_MM, size=(_WAVES, 1)) * direction
    phase = rng.uniform(0.0, 2 * np.pi, size=_WAVES)
    push = rng.normal(scale=size_mm * np.sqrt(2.0 / _WAVES), size=(_WAVES, 3))
    return np.asarray(np.sin(points @ number.T + phase) @ push)


def _dropouts(shape: tuple[int, ...], rate: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return where (T, M) markers are lost for a moment."""
    lost = np.zeros(shape, dtype=bool)
    for frame, marker in np.argwhere(rng.random(shape) < rate):
        lost[frame : frame + int(rng.integers(1, 6)), marker] = True
    return lost


def _swap(observed: FloatArray, truth: FloatArray, rate: float, rng: np.random.Generator) -> None:
    """Exchange neighbouring markers now and then, in place."""
    for frame in np.flatnonzero(rng.random(len(observed)) < rate):
        one = int(rng.integers(observed.shape[1]))
        away = np.linalg.norm(truth[frame] - truth[frame, one], axis=1)
        other = int(np.argsort(away)[1])
        span = slice(frame, frame + int(rng.integers(2, 21)))
        observed[span, [one, other]] = observed[span, [other, one]]


def _ghosts(observed: FloatArray, rate: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return trajectories (T, G, 3) of points that are no marker."""
    births = np.flatnonzero(rng.random(len(observed)) < rate)
    ghosts = np.full((len(observed), len(births), 3), np.nan, dtype=np.float32)
    for number, frame in enumerate(births):
        near = np.nanmean(observed[frame], axis=0) + rng.normal(scale=120.0, size=3)
        span = slice(frame, frame + int(rng.integers(1, 11)))
        ghosts[span, number] = near
    return ghosts
