"""The applications and their one command line.

Examples
--------
A programme dubbed from Python, and received again:

>>> from codec import load_voice
>>> from cuecast import SynthesisedMotion, dub, receive
>>> from synth import read_subtitles, score_of_subtitles
>>> voice = load_voice("claire")
>>> def whole_way(programme: str, subtitles: str, target: str) -> tuple[int, int]:
...     score = score_of_subtitles(read_subtitles(subtitles))
...     dub(programme, SynthesisedMotion(score, voice), voice, target)
...     found = receive(target, voice).summary
...     return len(score.keys), len(found["keys"])
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cuecast.command.cli import main
    from cuecast.dubbing.dub import DubOptions, dub
    from cuecast.dubbing.motions import GivenMotion, MotionSource, SynthesisedMotion
    from cuecast.dubbing.receive import Reception, receive

__all__ = [
    "DubOptions",
    "GivenMotion",
    "MotionSource",
    "Reception",
    "SynthesisedMotion",
    "dub",
    "main",
    "receive",
]

_HOMES = {
    "DubOptions": "cuecast.dubbing.dub",
    "GivenMotion": "cuecast.dubbing.motions",
    "MotionSource": "cuecast.dubbing.motions",
    "Reception": "cuecast.dubbing.receive",
    "SynthesisedMotion": "cuecast.dubbing.motions",
    "dub": "cuecast.dubbing.dub",
    "main": "cuecast.command.cli",
    "receive": "cuecast.dubbing.receive",
}
"""Where each name lives: it is imported when it is first asked for, so that importing is cheap."""

__version__: str
"""Version of the installed distribution."""

if not TYPE_CHECKING:  # type checkers would take any name for one of ours

    def __getattr__(name: str) -> Any:
        if name == "__version__":
            return import_module("cuecast.command.version").installed_version()
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
