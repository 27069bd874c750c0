"""Compiled kernels of the corpora: which cameras see a marker."""

import math

import numpy as np

from codec.compiled import njit


@njit(cache=True)
def count_cameras(
    points: np.ndarray,
    normals: np.ndarray,
    cameras: np.ndarray,
    least_cosine: float,
    enough: int,
    rod_start: np.ndarray,
    rod_end: np.ndarray,
    rod_radius: np.ndarray,
    bulk_centre: np.ndarray,
    bulk_map: np.ndarray,
    out: np.ndarray,
) -> None:
    """Count the cameras that see each marker, up to `enough`.

    Parameters
    ----------
    points, normals : float64 (T, M, 3)
        Markers, mm, and outward normals of the skin.
    cameras : float64 (C, 3)
        Positions, mm.
    least_cosine : float
        Of the angle between normal and line of sight.
    enough : int
        Counting stops here.
    rod_start, rod_end : float64 (T, K, 3)
        Axes of the capsules in the way (fingers, forearm, neck), mm.
    rod_radius : float64 (K,)
        Their radii, mm; a marker within its own capsule is not hidden by it.
    bulk_centre : float64 (T, E, 3)
        Centres of the ellipsoids in the way (the head).
    bulk_map : float64 (T, E, 3, 3)
        Maps of each ellipsoid to the unit sphere.
    out : int64 (T, M)
        Counts.
    """
    frames, markers = points.shape[:2]
    d = np.empty(3)
    w = np.empty(3)
    for t in range(frames):
        for m in range(markers):
            seen = 0
            for c in range(cameras.shape[0]):
                length = 0.0
                for i in range(3):
                    d[i] = cameras[c, i] - points[t, m, i]
                    length += d[i] * d[i]
                length = math.sqrt(length)
                cosine = 0.0
                for i in range(3):
                    d[i] /= length
                    cosine += d[i] * normals[t, m, i]
                if cosine < least_cosine:
                    continue
                # Ellipsoid, mapped to the unit sphere: |b + s a|**2 = 1 has a root s > 0 on the
                # line of sight if a.b < 0 and (a.b)**2 > |a|**2 (|b|**2 - 1).
                blocked = False
                for e in range(bulk_centre.shape[1]):
                    dd = 0.0
                    ww = 0.0
                    dw = 0.0
                    for i in range(3):
                        a = 0.0
                        b = 0.0
                        for j in range(3):
                            a += bulk_map[t, e, i, j] * d[j]
                            b += bulk_map[t, e, i, j] * (points[t, m, j] - bulk_centre[t, e, j])
                        dd += a * a
                        ww += b * b
                        dw += a * b
                    if dw < 0.0 and dw * dw > dd * (ww - 1.0):
                        blocked = True
                        break
                if blocked:
                    continue
                # Capsule: least distance between the axis p + s u, 0 <= s <= 1, and the line of
                # sight x + along d, along >= 0; `gap` is its square.
                for k in range(rod_start.shape[1]):
                    uu = 0.0
                    ud = 0.0
                    uw = 0.0
                    dw = 0.0
                    ww = 0.0
                    for i in range(3):
                        u = rod_end[t, k, i] - rod_start[t, k, i]
                        w[i] = points[t, m, i] - rod_start[t, k, i]
                        uu += u * u
                        ud += u * d[i]
                        uw += u * w[i]
                        dw += d[i] * w[i]
                        ww += w[i] * w[i]
                    r2 = rod_radius[k] * rod_radius[k]
                    s = min(max(uw / uu, 0.0), 1.0)
                    if ww - 2.0 * s * uw + s * s * uu <= r2:
                        continue
                    bend = uu - ud * ud
                    s = 0.0
                    if bend > 1e-9:
                        s = min(max((uw - ud * dw) / bend, 0.0), 1.0)
                    along = s * ud - dw
                    if along < 0.0:
                        along = 0.0
                        s = min(max(uw / uu, 0.0), 1.0)
                    gap = (
                        ww
                        + along * along
                        + s * s * uu
                        + 2.0 * along * dw
                        - 2.0 * s * uw
                        - 2.0 * along * s * ud
                    )
                    if gap < r2:
                        blocked = True
                        break
                if blocked:
                    continue
                seen += 1
                if seen >= enough:
                    break
            out[t, m] = seen
