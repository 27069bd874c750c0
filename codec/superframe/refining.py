"""Refining: coefficients of a filmed superframe by the error that a viewer will see.

The transform measures by one metric, that of the voice's mean, and each superframe for itself. What
a receiver shows depends on the poses of the moment, and is blended with the superframes before and
after (Q7). A setting and coefficients go in; coefficients come out that were changed one by one to
where that error and their bits are least, at the setting's step and the two beside it. Nothing of
it is on air.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.cues.timeline import TICKS
from codec.superframe import _kernels
from codec.superframe.decoder import BLEND
from codec.superframe.quantise import (
    NO_RESIDUAL,
    WEIGHT,
    Setting,
    dequantise,
    quantise_rd,
    raised,
    width_mm,
)
from codec.superframe.tables import coefficient_tables
from codec.superframe.transform import COSINES, Bases, Basis

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

REACH = len(BLEND)
"""Frames of a neighbour that a superframe moves."""

_STEP = 1e-2
"""Change of a parameter that slopes are taken from."""

_NEAR = 1
"""Steps to either side that are tried."""

_ROUNDS = 24
"""Times that the weight of bits is set anew; 14 leave half a hundredth more of the error."""

_TURN = 3.4
"""By how much a weight grows for each part of the room that is exceeded, as a logarithm."""

_MOST_TURN = 0.3
"""Greatest change of a weight's logarithm in a round."""

_LIGHT = 0.05
"""Weight of bits where a coarser or finer step begins with what another one said."""

_OVER_BITS = 1.0
"""Bits that coefficients may exceed their room by: the parts' ends decide what fits."""


@dataclass(frozen=True, slots=True)
class Neighbour:
    """A filmed superframe beside one.

    Attributes
    ----------
    meant : ndarray of float64, shape (32, P)
        The intended parameters.
    drawn : ndarray of float64, shape (32, P)
        The receiver's parameters before blending.
    metrics : ndarray of float64, shape (32, P, P)
        See `metrics_of`.
    """

    meant: Array
    drawn: Array
    metrics: Array


def metrics_of(voice: Voice, poses: Array) -> Array:
    """Return the matrix of each pose that weighs small changes as its markers do.

    Parameters
    ----------
    voice : Voice
    poses : ndarray of float64, shape (T, P)

    Returns
    -------
    ndarray of float64, shape (T, P, P)
        mm**2 over all markers for the square of a change of parameters.
    """
    frames, size = poses.shape
    steps = _STEP * np.eye(size)
    moved = np.concatenate([poses[:, None] + steps, poses[:, None] - steps], axis=1)
    markers = voice.reconstruct(moved.reshape(-1, size)).astype(np.float64)
    sides = markers.reshape(frames, 2, size, -1)
    slopes = (sides[:, 0] - sides[:, 1]) / (2 * _STEP)
    return np.asarray(slopes @ slopes.transpose(0, 2, 1))


class SeenError:
    """The visible error of a superframe and of its effect on its neighbours.

    Parameters
    ----------
    own : Neighbour
        The superframe itself; its `drawn` is not used.
    before, after : Neighbour or None
        None where no filmed superframe is known to stand.

    Attributes
    ----------
    map : ndarray of float64, shape (32 + 2 REACH, 32)
        Frames seen, the neighbours' among them, by the superframe's own frames.
    lacking : ndarray of float64, shape (32 + 2 REACH, P)
        What they lack if its own parameters are zero.
    metrics : ndarray of float64, shape (32 + 2 REACH, P, P)
    """

    def __init__(self, own: Neighbour, before: Neighbour | None, after: Neighbour | None) -> None:
        size = own.meant.shape[1]
        self.map = np.zeros((TICKS + 2 * REACH, TICKS))
        self.map[REACH:-REACH] = np.eye(TICKS)
        self.lacking = np.zeros((len(self.map), size))
        self.lacking[REACH:-REACH] = own.meant
        self.metrics = np.zeros((len(self.map), size, size))
        self.metrics[REACH:-REACH] = own.metrics
        # Beyond each border the decoder blends both sides' linear extrapolations (1.5 x_1 - 0.5
        # x_2) over 2 REACH ticks: `map` has this superframe's part of the blend, `lacking` the
        # neighbours'.
        sharing = np.concatenate([BLEND[::-1], -BLEND])
        if before is not None:
            border, left = slice(0, 2 * REACH), before.drawn
            self.map[border, :2] += sharing * [1.5, -0.5]
            self.lacking[:REACH] = before.meant[-REACH:] - left[-REACH:]
            self.lacking[border] += sharing * (1.5 * left[-1] - 0.5 * left[-2])
            self.metrics[:REACH] = before.metrics[-REACH:]
        if after is not None:
            border, right = slice(TICKS, TICKS + 2 * REACH), after.drawn
            self.map[border, -2:] += sharing * [0.5, -1.5]
            self.lacking[-REACH:] = after.meant[:REACH] - right[:REACH]
            self.lacking[border] -= sharing * (1.5 * right[0] - 0.5 * right[1])
            self.metrics[-REACH:] = after.metrics[:REACH]

    def of(self, drawn: Array) -> float:
        """Return the squared error of a superframe drawn so, shape (32, P): mm**2 in all."""
        gap = self.lacking - self.map @ drawn
        return float((np.einsum("tp,tpq->tq", gap, self.metrics) * gap).sum())


@dataclass(frozen=True, slots=True)
class Refined:
    """Coefficients that were found.

    Attributes
    ----------
    error : float
        See `SeenError.of`.
    setting : Setting
    q : ndarray of int64, shape (32 P,)
    """

    error: float
    setting: Setting
    q: Ints


def refined(
    error: SeenError, predicted: Array, setting: Setting, q: Ints, bases: Bases, bits: float
) -> list[Refined]:
    """Return settings and coefficients near given ones that fit, about, those of least error first.

    Parameters
    ----------
    error : SeenError
    predicted : ndarray of float64, shape (32, P)
        The used part of the superframe's prediction.
    setting, q
        From where to begin.
    bases : Bases
    bits : float
        Room for the coefficients.
    """
    basis, tables = bases[setting.basis], coefficient_tables()
    begun = dequantise(q, setting, basis, tables)
    descent, found = _Descent(error, basis), list[Refined]()
    for step in range(max(setting.step - _NEAR, 0), min(setting.step + _NEAR + 1, NO_RESIDUAL)):
        tried = replace(setting, step=step)
        near = quantise_rd(begun, tried, basis, tables, weight=_LIGHT)
        for indices in descent.run(predicted, tried, near, bits):
            drawn = predicted + basis.backward(dequantise(indices, tried, basis, tables))
            found.append(Refined(error.of(drawn), tried, indices))
    return sorted(found, key=lambda one: one.error)


class _Descent:
    """Descent of an error over the coefficients of a basis."""

    def __init__(self, error: SeenError, basis: Basis) -> None:
        self._error, self._basis = error, basis
        self._waves = np.ascontiguousarray(error.map @ COSINES.T)
        self._metric = np.ascontiguousarray(basis.inverse @ error.metrics @ basis.inverse.T)
        self._grid = basis.order // TICKS, basis.order % TICKS
        curves = np.square(self._waves).T @ np.einsum("tcc->tc", self._metric)
        self._curves = np.ascontiguousarray(curves[self._grid[1], self._grid[0]])

    def run(self, predicted: Array, setting: Setting, q: Ints, bits: float) -> Iterator[Ints]:
        """Yield coefficients that fit, about, each once."""
        basis, tables = self._basis, coefficient_tables()
        scales, width = raised(basis, setting), width_mm(setting.step)
        drawn = predicted + basis.backward(dequantise(q, setting, basis, tables))
        gap = self._error.lacking - self._error.map @ drawn
        # Gradient of the squared error to the dequantised coefficients.
        slopes = np.einsum("tp,tpq->tq", gap, self._error.metrics) @ basis.inverse.T
        q, seen, weight = q.copy(), set[bytes](), WEIGHT * width * width
        for _ in range(_ROUNDS):
            for _ in range(2):
                if not _kernels.descend(
                    q, scales, (basis.before, basis.after), setting.step, width, weight,
                    tables.cost, tables.inset, self._grid, self._waves, slopes, self._metric,
                    self._curves,
                ):  # fmt: skip
                    break
            told = _kernels.coefficient_cost(q, scales, basis.before, setting.step, tables.cost)
            if told <= bits + _OVER_BITS and q.tobytes() not in seen:
                seen.add(q.tobytes())
                yield q.copy()
            # The price of a bit rises while the coefficients are too long, and falls while there is
            # room.
            turn = _TURN * (told - bits) / max(bits, 1.0)
            weight *= float(np.exp(np.clip(turn, -_MOST_TURN, _MOST_TURN)))
