"""The targets of a voice: where its parameters go for each key and phone (P8)."""

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from codec.cuer.gestures import GestureTable
from codec.cues.phonology import PHONES
from codec.cues.score import PLACEMENTS, SHAPES
from codec.errors import VoiceError

Array = NDArray[np.float64]

N_KEYS = len(SHAPES) * len(PLACEMENTS)


@dataclass(frozen=True, slots=True)
class Targets:
    """Where the parameters of a voice go for each key and phone.

    Attributes
    ----------
    hand, head, forearm : ndarray of float64, shape (54, 12), (54, nmF), (54, nmH)
        Parameters when a key is held; key number = 6 shape + placement.
    arc : ndarray of float64, shape (nmH,)
        Forearm parameters by which the middle of a movement leaves the straight line, per unit
        of distance between its ends.
    face : ndarray of float64, shape (38, 7)
        Parameters of each phone.
    carried, carried_arc : ndarray of float64, shape (54, nmF + nmH), (nmF + nmH,)
        Head and forearm side by side, and their `arc`.
    """

    hand: Array
    head: Array
    forearm: Array
    arc: Array
    face: Array
    carried: Array = field(init=False)
    carried_arc: Array = field(init=False)

    def __post_init__(self) -> None:
        for item in (item for item in fields(self) if item.init):
            array = np.ascontiguousarray(getattr(self, item.name), dtype=np.float64)
            rows = {"face": len(PHONES), "arc": self.forearm.shape[-1]}.get(item.name, N_KEYS)
            if len(array) != rows or not np.isfinite(array).all():
                raise VoiceError(f"targets: {item.name} has shape {array.shape}, not {rows} rows")
            object.__setattr__(self, item.name, array)
        object.__setattr__(self, "carried", np.concatenate([self.head, self.forearm], axis=1))
        arc = np.concatenate([np.zeros(self.head.shape[1]), self.arc])
        object.__setattr__(self, "carried_arc", arc)

    @classmethod
    def of(cls, table: GestureTable) -> "Targets":
        """Return the exact targets of a gesture table, reached on straight lines."""
        n_forearm = table.placement_targets.shape[-1]
        return cls(
            np.repeat(table.shape_targets, len(PLACEMENTS), axis=0).astype(np.float64),
            np.tile(table.neutral_head, (N_KEYS, 1)).astype(np.float64),
            table.placement_targets.reshape(N_KEYS, n_forearm).astype(np.float64),
            np.zeros(n_forearm),
            table.viseme_targets.astype(np.float64),
        )
