"""The set-top box: from a programme to a cuer on the screen.

A `Receiver` takes the programme block by block and answers with events: keys and motion with
their times, the state of reception, losses.

Examples
--------
A programme in blocks to keys, each once, and to markers; this one is silent:

>>> import numpy as np
>>> from receiver import Event, KeysFound, MotionPiece, Receiver
>>> box = Receiver(48000, 2)
>>> programme = np.zeros((48000, 2), dtype=np.float32)
>>> events: list[Event] = []
>>> for i in range(0, 48000, 4800):
...     events += box.process(programme[i : i + 4800])
>>> events += box.flush()
>>> [key for e in events if isinstance(e, KeysFound) and e.final for key in e.keys]
[]
>>> markers = [box.voice.reconstruct(e.params) for e in events if isinstance(e, MotionPiece)]
>>> box.state, box.summary()["superframes"]
('searching', {'received': 0, 'lost': 0})
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from receiver.drawing.render import draw
    from receiver.reception.authenticity import Trust
    from receiver.reception.engine import Receiver
    from receiver.reception.events import (
        AuthenticityChanged,
        Event,
        KeysFound,
        MotionPiece,
        StateChanged,
        SuperframeLost,
        Unreadable,
    )

__all__ = [
    "AuthenticityChanged",
    "Event",
    "KeysFound",
    "MotionPiece",
    "Receiver",
    "StateChanged",
    "SuperframeLost",
    "Trust",
    "Unreadable",
    "draw",
]

_HOMES = {
    "AuthenticityChanged": "receiver.reception.events",
    "Event": "receiver.reception.events",
    "KeysFound": "receiver.reception.events",
    "MotionPiece": "receiver.reception.events",
    "Receiver": "receiver.reception.engine",
    "StateChanged": "receiver.reception.events",
    "SuperframeLost": "receiver.reception.events",
    "Trust": "receiver.reception.authenticity",
    "Unreadable": "receiver.reception.events",
    "draw": "receiver.drawing.render",
}
"""Where each name lives: it is imported when it is first asked for, so that importing is cheap."""

if not TYPE_CHECKING:  # type checkers would take any name for one of ours

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
