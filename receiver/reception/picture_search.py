"""The carriers of a picture: luma in, superframes out, each with its carrier's name."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from numpy.typing import NDArray

from codec.errors import CueError
from watermark.a335.carrier import A335Receiver
from watermark.link.link import Rates
from watermark.link.superframe import ReceivedSuperframe
from watermark.video.receive import VideoReceiver

TRIAL_S = 8.0
"""If nothing is found in so much picture, it is not looked at for a while."""

AGAIN_S = 3.0
"""The same for a picture without a find so far: twice the time of tuning in."""


@dataclass(frozen=True, slots=True)
class Found:
    """A superframe of a carrier; `profile` gives the meaning of its ratios, if it has any."""

    carrier: str
    superframe: ReceivedSuperframe
    profile: Rates | None


class PictureCarriers:
    """The receivers that serve a picture.

    Parameters
    ----------
    width, height : int
        Pixels.
    fps : Fraction, int or float
        Frames per second.
    depth : int
        Bits per sample.
    key : int
        Key of the invisible mark.
    start_s : float
        Time of the first frame.
    trial_s : float
        How long to look where nothing is found.
    guess : bool
        Whether crops of the marked picture are searched for.

    Attributes
    ----------
    ber_estimates : dict of str to float or None
        Of the carriers that were found: wrong bits before correction, where the carrier knows.
    """

    def __init__(
        self, width: int, height: int, fps: Fraction | float, *, depth: int = 8, key: int = 0,
        start_s: float = 0.0, trial_s: float = TRIAL_S, guess: bool = True,
    ) -> None:  # fmt: skip
        kinds: dict[str, Callable[[], Any]] = {
            "video": lambda: VideoReceiver(width, height, fps, key=key, depth=depth, crops=guess),
            "a335": lambda: A335Receiver(width, height, fps, depth=depth),
        }
        self._receivers: dict[str, Any] = {}
        for name, make in kinds.items():
            try:
                self._receivers[name] = make()
            except CueError:  # too small a picture or too strange a rate: it cannot be in there
                continue
        self._fps, self._start_s, self._trial_s = float(fps), start_s, trial_s
        self._frames = self._last_found = 0

    @property
    def hopeless(self) -> bool:
        """Whether nothing was found for so long that looking on hardly pays."""
        return self._frames - self._last_found > self._trial_s * self._fps or not self._receivers

    @property
    def now_s(self) -> float:
        """Time up to which frames came in."""
        return self._start_s + self._frames / self._fps

    @property
    def first_lock_s(self) -> float | None:
        """Time at which the first carrier was found."""
        times = [r.first_lock_s for r in self._receivers.values() if r.first_lock_s is not None]
        return self._start_s + min(times) if times else None

    @property
    def ber_estimates(self) -> dict[str, float | None]:
        """Wrong bits before correction of each carrier that was found."""
        return {
            name: getattr(receiver, "ber_estimate", None)
            for name, receiver in self._receivers.items()
            if receiver.first_lock_s is not None
        }

    def process(self, luma: NDArray[Any]) -> list[Found]:
        """Take the next frame, shape (height, width)."""
        self._frames += 1
        return [
            f for name, r in self._receivers.items() for f in self._named(name, r.process(luma))
        ]

    def wait(self, misses: int) -> None:
        """Let the invisible carrier give up its lock after too many failures in a row."""
        if "video" in self._receivers:
            self._receivers["video"].wait(misses)

    def flush(self) -> list[Found]:
        """Return the superframes in the last frames."""
        receiver = self._receivers.get("video")
        return [] if receiver is None else self._named("video", receiver.flush())

    def _named(self, name: str, superframes: list[ReceivedSuperframe]) -> list[Found]:
        if any(superframe.l0 for superframe in superframes):
            self._last_found = self._frames
        profile = self._receivers[name].profile if name == "video" else None
        return [
            Found(name, replace(s, position_s=self._start_s + s.position_s), profile)
            for s in superframes
        ]
