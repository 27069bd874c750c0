"""The targets of a voice: where its parameters go for each key and phone (P8)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from codec.cuer.movement import FLOWING, Movement
from codec.cuer.voice import Voice
from codec.cues.timeline import TICK_S
from codec.errors import VoiceError

Array = NDArray[np.float64]

PARTS = 100
"""Movements are timed in whole hundredths of a tick: both ends compute the same numbers."""

PARTS_PER_S = PARTS / TICK_S


@dataclass(frozen=True, slots=True)
class Targets:
    """Where the parameters of a voice go for each key and phone, and how.

    Attributes
    ----------
    hand, head, forearm : ndarray of float64, shape (54, 12), (54, nmF), (54, nmH)
        Parameters when a key is held, by its number (`Language.key_number`); of French 54.
    arc : ndarray of float64, shape (nmH,)
        Forearm parameters: deviation of a movement's middle from the straight line, per unit
        of distance between its ends.
    face : ndarray of float64, shape (38, 7)
        Parameters of each phone.
    movement : Movement
        Of the voice.
    places : ndarray of float64, shape (54, 3)
        Where the hand is for each key, mm, for the length of its way.
    late : ndarray of float64, shape (12 + nmF + nmH,)
        How much later than its group each parameter of hand, head and forearm moves, seconds.
    moving, moving_arc : ndarray of float64, shape (54, M), (M,)
        Hand, head and forearm side by side, and their `arc`.
    lateness : tuple of two ndarray of float64, shape (M,)
        How much later than the movement each of them begins and ends, hundredths of a tick.
    """

    hand: Array
    head: Array
    forearm: Array
    arc: Array
    face: Array
    movement: Movement = FLOWING
    places: Array = field(default_factory=lambda: np.zeros((0, 3)))
    late: Array = field(default_factory=lambda: np.zeros(0))
    moving: Array = field(init=False)
    moving_arc: Array = field(init=False)
    lateness: tuple[Array, Array] = field(init=False)

    def __post_init__(self) -> None:
        widths = [self.hand.shape[-1], self.head.shape[-1], self.forearm.shape[-1]]
        if self.late.size == 0:
            object.__setattr__(self, "late", np.zeros(sum(widths)))
        if self.places.size == 0:
            object.__setattr__(self, "places", np.zeros((len(self.hand), 3)))
        rows = {"face": len(self.face), "arc": widths[2], "late": sum(widths)}
        for name in ("hand", "head", "forearm", "arc", "face", "places", "late"):
            array = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            wanted = rows.get(name, len(self.hand))
            if len(array) != wanted or not np.isfinite(array).all():
                raise VoiceError(f"targets: {name} has shape {array.shape}, not {wanted} rows")
            object.__setattr__(self, name, array)
        # Hand, head and forearm move by one kernel: one table of targets, arcs and delays for all.
        moving = np.concatenate([self.hand, self.head, self.forearm], axis=1)
        object.__setattr__(self, "moving", moving)
        arc = np.concatenate([np.zeros(widths[0] + widths[1]), self.arc])
        object.__setattr__(self, "moving_arc", arc)
        m = self.movement
        groups = ((m.fingers_begin_s, m.head_begin_s, 0.0), (m.fingers_end_s, m.head_end_s, 0.0))
        begins, ends = (np.repeat(group, widths) + self.late for group in groups)
        object.__setattr__(self, "lateness", (PARTS_PER_S * begins, PARTS_PER_S * ends))

    @classmethod
    def of(cls, voice: Voice, movement: Movement = FLOWING) -> "Targets":
        """Return the exact targets of a voice's gesture table, reached on straight lines."""
        table = voice.gestures
        n_forearm = table.placement_targets.shape[-1]
        n_shapes, n_placements = table.placement_targets.shape[:2]
        n_keys = n_shapes * n_placements
        forearm = table.placement_targets.reshape(n_keys, n_forearm).astype(np.float64)
        return cls(
            np.repeat(table.shape_targets, n_placements, axis=0).astype(np.float64),
            np.tile(table.neutral_head, (n_keys, 1)).astype(np.float64),
            forearm,
            np.zeros(n_forearm),
            table.viseme_targets.astype(np.float64),
            movement,
            forearm @ voice.hand.motion_directions[:, 3:].astype(np.float64),
        )
