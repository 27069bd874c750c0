"""Markers over time as TRC and CSV; C3D is `codec.cuer.c3d`."""

import csv
import io

import numpy as np
from numpy.typing import NDArray

from codec.cuer.layout import MARKERS

FloatArray = NDArray[np.floating]


def trc(markers: FloatArray, rate_hz: float, name: str) -> str:
    """Return a TRC file (OpenSim, Motion Analysis): millimetres, tab separated.

    Parameters
    ----------
    markers : ndarray, shape (T, 113, 3)
        NaN marks a hidden marker; its fields stay empty.
    rate_hz : float
    name : str
        Written into the first line.
    """
    count = len(markers)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame"
        "\tOrigNumFrames",
        f"{rate_hz:g}\t{rate_hz:g}\t{count}\t{len(MARKERS)}\tmm\t{rate_hz:g}\t1\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(MARKERS) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(len(MARKERS)) for axis in "XYZ"),
        "",
    ]
    for number, frame in enumerate(markers):
        fields = ["" if np.isnan(v) else f"{v:.4f}" for v in frame.ravel()]
        lines.append(f"{number + 1}\t{number / rate_hz:.6f}\t" + "\t".join(fields))
    return "\n".join(lines) + "\n"


def marker_csv(markers: FloatArray, times_s: FloatArray) -> str:
    """Return a table: time, then x, y, z of every marker, millimetres; hidden ones empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time_s", *(f"{name}.{axis}" for name in MARKERS for axis in "xyz")])
    for time_s, frame in zip(times_s, markers, strict=True):
        writer.writerow(
            [f"{time_s:.6f}", *("" if np.isnan(v) else f"{v:.4f}" for v in frame.ravel())]
        )
    return text.getvalue()
