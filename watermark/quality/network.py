"""The neural network that turns eleven model output variables into one grade.

ITU-R BS.1387-1, Annex 2, section 6 (basic version): weights and ranges are the Recommendation's.
"""

import math

import numpy as np

from watermark.quality.movs import Movs

# One row per variable: lower and upper end of its range, weights to the three hidden nodes.
_INPUT = np.array(
    [
        [393.916656, 921.0, -0.502657, 0.436333, 1.219602],
        [361.965332, 881.131226, 4.307481, 3.246017, 1.123743],
        [-24.045116, 16.212030, 4.984241, -2.211189, -0.192096],
        [1.110661, 107.137772, 0.051056, -1.762424, 4.331315],
        [-0.206623, 2.886017, 2.321580, 1.789971, -0.754560],
        [0.074318, 13.933351, -5.303901, -3.452257, -10.814982],
        [1.113683, 63.257874, 2.730991, -6.111805, 1.519223],
        [0.950345, 1145.018555, 0.624950, -1.331523, -5.955151],
        [0.029985, 14.819740, 3.102889, 0.871260, -5.922878],
        [0.000101, 1.0, -1.051468, -0.939882, -0.142913],
        [0.0, 1.0, -1.804679, -0.503610, -0.620456],
    ]
)
_HIDDEN_BIAS = np.array([-2.518254, 0.654841, -2.207228])
_HIDDEN = np.array([-3.817048, 4.107138, 4.629582])
_BIAS = -0.307594
_ODG_MIN, _ODG_MAX = -3.98, 0.22


def distortion_index(movs: Movs) -> float:
    """Distortion index: large is good, 1.5 and more is transparent."""
    low, high = _INPUT[:, 0], _INPUT[:, 1]
    hidden = _HIDDEN_BIAS + ((movs.as_array() - low) / (high - low)) @ _INPUT[:, 2:]
    return float(_BIAS + _HIDDEN @ (1 / (1 + np.exp(-hidden))))


def difference_grade(index: float) -> float:
    """Objective difference grade of a distortion index: 0 imperceptible to -4 very annoying.

    Examples
    --------
    >>> round(difference_grade(0.0), 2)
    -1.88
    """
    return _ODG_MIN + (_ODG_MAX - _ODG_MIN) / (1 + math.exp(-index))
