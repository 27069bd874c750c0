"""Labelled C3D files of the 113 markers; they are written by ezc3d (the optional extra ``c3d``).

Points are in millimetres. A hidden marker is NaN here and has residual -1 in the file. Points
that are no marker are labelled ``*1``, ``*2``, ... and any file with the markers' names can be
read, whoever made it, also with further points in it.
"""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from codec.cuer.layout import MARKERS
from codec.errors import CueError
from codec.files.c3d_points import open_c3d
from codec.files.whole import whole_file

_MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0}


def write_c3d(
    path: str | os.PathLike[str],
    markers: ArrayLike,
    *,
    rate_hz: float,
    start_s: float = 0.0,
    ghosts: ArrayLike | None = None,
) -> None:
    """Write markers as a labelled C3D file.

    Parameters
    ----------
    path : path-like
    markers : array_like, shape (T, 113, 3)
        Millimetres, order of `codec.cuer.layout.MARKERS`; NaN where hidden.
    rate_hz : float
    start_s : float
        Time of the first frame, to the nearest frame; kept as the file's first frame number.
    ghosts : array_like, shape (T, G, 3), optional
        Points that are no marker.

    Raises
    ------
    CueError
        If ezc3d is not installed, or the markers have another shape.
    """
    points = np.asarray(markers, dtype=np.float64)
    if points.ndim != 3 or points.shape[1:] != (len(MARKERS), 3):
        raise CueError(f"markers have shape {points.shape}, expected (T, {len(MARKERS)}, 3)")
    labels = list(MARKERS)
    if ghosts is not None and np.size(ghosts):
        extra = np.asarray(ghosts, dtype=np.float64)
        points = np.concatenate([points, extra], axis=1)
        labels += [f"*{number}" for number in range(1, extra.shape[1] + 1)]
    c3d = _ezc3d().c3d()
    c3d["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    c3d["parameters"]["POINT"]["RATE"]["value"] = [rate_hz]
    c3d["parameters"]["POINT"]["LABELS"]["value"] = labels
    # C3D stores homogeneous columns; a residual of -1 marks a point as not measured.
    homogeneous = np.ones((4, points.shape[1], len(points)))
    homogeneous[:3] = points.transpose(2, 1, 0)
    hidden = np.isnan(homogeneous[:3]).any(axis=0)
    c3d["data"]["points"] = homogeneous
    c3d["data"]["meta_points"]["residuals"] = np.where(hidden, -1.0, 0.0)[None]
    c3d["header"]["points"]["first_frame"] = max(round(start_s * rate_hz), 0)
    try:
        with whole_file(path) as temporary:
            c3d.write(str(temporary))
    except (OSError, RuntimeError, ValueError) as error:
        raise CueError(f"{path}: cannot write C3D: {error}") from error


def read_c3d(path: str | os.PathLike[str]) -> tuple[NDArray[np.float32], float, float]:
    """Read the 113 markers of a C3D file.

    Returns
    -------
    markers : ndarray of float32, shape (T, 113, 3)
        Millimetres; NaN where hidden.
    rate_hz : float
    start_s : float
        Time of the first frame.

    Raises
    ------
    CueError
        If the file is no C3D, its unit is strange, or a marker's name is missing or stands there
        twice.
    """
    file = open_c3d(path)
    unit = file.unit or "mm"
    if unit not in _MILLIMETRES:
        raise CueError(f"{path}: unit {unit!r} is not one of {', '.join(_MILLIMETRES)}")
    bare = [label.split(":")[-1] for label in file.labels]
    twice = [name for name in MARKERS if bare.count(name) > 1]
    if twice:
        raise CueError(f"{path}: marker {twice[0]} stands there {bare.count(twice[0])} times")
    column = {label: number for number, label in enumerate(bare)}
    missing = [name for name in MARKERS if name not in column]
    if missing:
        raise CueError(f"{path}: {len(missing)} markers are missing, the first is {missing[0]}")
    columns = [column[name] for name in MARKERS]
    markers = np.float32(_MILLIMETRES[unit]) * file.frames(0, file.n_frames)[:, columns]
    return markers, file.rate_hz, file.start_s


def _ezc3d() -> Any:
    try:
        import ezc3d
    except ImportError:
        raise CueError("C3D files need the package ezc3d: pip install 'cuecast[c3d]'") from None
    return ezc3d
