"""Events of a receiver while a programme passes through it; times on the programme's clock."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from codec.cues.score import Key, Phone

SUPERFRAME_S = 0.64
"""Length of a superframe on air and of the motion inside it, seconds."""

State = Literal["searching", "locked", "degraded", "lost", "ended"]
"""Searching: nothing found yet. Locked: superframes arrive. Degraded: some are missing. Lost:
the carrier was there and is gone. Ended: the programme is over."""


@dataclass(frozen=True, slots=True)
class StateChanged:
    """Reception changed.

    Attributes
    ----------
    time_s : float
        On the programme's clock.
    state : State
        The state from then on.

    Examples
    --------
    >>> StateChanged(2.4, "locked").state
    'locked'
    """

    time_s: float
    state: State


@dataclass(frozen=True, slots=True)
class MotionPiece:
    """The motion of one superframe at its place on the programme's clock.

    Attributes
    ----------
    start_s : float
        Time of the first frame.
    rate_hz : float
        Frames per second.
    params : ndarray of float32, shape (T, P)
        Parameters of the voice, read-only.
    layers : tuple of str
        Layers that arrived: ``L0``, ``L1``. Empty if the piece is concealment.
    epoch : int
        Counts discontinuities of the stream; pieces of one epoch lie on one grid of frames.
    phones : tuple of Phone
        Phones that start within the piece, as far as known.

    Examples
    --------
    >>> piece = MotionPiece(2.56, 50.0, np.zeros((32, 31), np.float32), ("L0", "L1"))
    >>> round(piece.end_s, 2)
    3.2
    """

    start_s: float
    rate_hz: float
    params: NDArray[np.float32]
    layers: tuple[str, ...]
    epoch: int = 0
    phones: tuple[Phone, ...] = ()

    @property
    def end_s(self) -> float:
        """Time at which the next piece starts."""
        return self.start_s + len(self.params) / self.rate_hz


@dataclass(frozen=True, slots=True)
class KeysFound:
    """Keys that start within one superframe, in order of time.

    They come twice: as soon as the superframe arrived, when the end of the last one may still be
    a guess, and once again when they are certain.

    Attributes
    ----------
    keys : tuple of Key
    final : bool
        Whether nothing of them will change.

    Examples
    --------
    >>> from codec import Key
    >>> found = KeysFound((Key(0.0, 0.25, ("b", "a"), 4, "side"),), final=True)
    >>> [str(key) for key in found.keys]
    ['14']
    """

    keys: tuple[Key, ...]
    final: bool


@dataclass(frozen=True, slots=True)
class SuperframeLost:
    """Superframes that did not arrive, one after the other.

    Of a long gap only the ends have pieces of motion: the hand rests in the middle.

    Attributes
    ----------
    start_s : float
        When the first one was due on the programme's clock.
    count : int

    Examples
    --------
    >>> SuperframeLost(6.4).count
    1
    """

    start_s: float
    count: int = 1


@dataclass(frozen=True, slots=True)
class Unreadable:
    """The stream has another voice or version: it is not drawn.

    Reported once; it holds until a superframe is drawn again.

    Attributes
    ----------
    time_s : float
        From when on, on the programme's clock.
    message : str
        Its content, for a person to read.

    Examples
    --------
    >>> Unreadable(0.0, "the sound has no channels").message
    'the sound has no channels'
    """

    time_s: float
    message: str


@dataclass(frozen=True, slots=True)
class AuthenticityChanged:
    """From `time_s` on the cues are known to be, or not to be, those of a broadcaster.

    Attributes
    ----------
    time_s : float
    status : str
        ``verified``, ``unknown`` or ``forged``; ``unsigned`` where the cues carry no proof.
    of : str
        The broadcaster's name.
    reason : str
        Why they are not verified.
    age_s : float or None
        How old they are on arrival, by the keys; None where no clock is right.

    Examples
    --------
    >>> AuthenticityChanged(10.2, "verified", "Chaîne 1", age_s=0.4).status
    'verified'
    """

    time_s: float
    status: Literal["unknown", "verified", "forged", "unsigned"]
    of: str
    reason: str = ""
    age_s: float | None = None


Event = StateChanged | MotionPiece | KeysFound | SuperframeLost | Unreadable | AuthenticityChanged
"""All that `Receiver` reports."""
