"""Mark a picture: frames in, the same frames with superframes inside out.

Each superframe is one pattern, constant between fades; its amplitudes move the mean projection of
every cell over the superframe onto the lattice point of the cell's bit. Specification:
spec/video-carrier.md.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.link.inputs import checked_payload
from watermark.video.codec_loop import PictureLoop
from watermark.video.design import Design, Strength, fixed_strength
from watermark.video.fading import PatternWriter
from watermark.video.grid import Grid
from watermark.video.modes import make_modes
from watermark.video.painting import Painter
from watermark.video.profile import (
    COLUMNS,
    LONE,
    ROWS,
    STEPS,
    TEMPLATES,
    TEXTURE_EVERY,
    VideoProfile,
    find_profile,
)
from watermark.video.strength_choice import TriedChannel
from watermark.video.timing import Timing

Luma = NDArray[Any]
FloatArray = NDArray[np.float64]
Source = Callable[[int], tuple[bytes, bytes]]


@dataclass(frozen=True, slots=True)
class VideoReport:
    """What an embedder did.

    Attributes
    ----------
    frames, superframes : int
        Frames put out, superframes marked.
    psnr_db : float
        Peak signal-to-noise ratio of the marked luma.
    net_bps, gross_bps : float
        Rates of the profile.
    steps : tuple of int
        Superframes that have each of `STEPS`.
    lone : int
        Superframes that carry L0 alone, since L1 would not have arrived.

    Examples
    --------
    >>> embedder = VideoEmbedder(320, 180, 25, lambda k: (bytes(20), bytes(140)))
    >>> embedder.report().superframes
    0
    """

    frames: int
    superframes: int
    psnr_db: float
    net_bps: float
    gross_bps: float
    steps: tuple[int, ...]
    lone: int


class VideoEmbedder:
    """Write superframes invisibly into luma.

    Parameters
    ----------
    width, height : int
        Pixels of the picture, at least 320x180.
    fps : Fraction, int or float
        Frames per second.
    source : callable
        `source(k)` gives (l0, l1) of the superframe that goes on air at k * 0.64 s.
    profile : str
        "robust", "standard" or "high".
    key : int
        Secret seed; both ends must agree.
    depth : int
        Bits per sample.
    strength : float
        Factor of the profile's step.
    channels : sequence of TriedChannel
        Coders on which the strength of each superframe is tried; without any it is fixed.

    Raises
    ------
    CueError
        If size, rate, depth, strength, profile or key are out of range.

    Examples
    --------
    A grey picture with slight noise, marked for a second and a half:

    >>> picture = np.random.default_rng(1).integers(90, 160, (180, 320), dtype=np.uint8)
    >>> embedder = VideoEmbedder(320, 180, 25, lambda k: (bytes(20), bytes(140)))
    >>> marked = [frame for _ in range(32) for frame in embedder.process(picture)]
    >>> marked += embedder.flush()
    >>> len(marked), embedder.report().superframes
    (32, 2)
    """

    def __init__(
        self,
        width: int,
        height: int,
        fps: Fraction | float,
        source: Source,
        *,
        profile: str = "standard",
        key: int = 0,
        depth: int = 8,
        strength: float = 1.0,
        channels: Sequence[TriedChannel] = (),
    ) -> None:
        if not 0.2 <= strength <= 8:
            raise CueError(f"strength {strength}: must be 0.2..8")
        self._grid = Grid(width, height, depth)
        self._painter = Painter(width, height, depth)
        self._timing = Timing(Fraction(fps))
        self._profile = find_profile(profile)
        self._modes = sum((make_modes(p, key, strength) for p in (self._profile, LONE)), ())
        self._source = source
        self._received = self._superframes = self._lone = 0
        self._steps = [0] * len(STEPS)
        self._sum = np.zeros((TEMPLATES, ROWS, COLUMNS))
        self._energy = np.zeros((ROWS, COLUMNS))
        self._textures: list[FloatArray] = []
        self._writer = PatternWriter(self._grid.shape, depth, self._timing)
        self._designs: deque[Design] = deque()
        self._loop = (
            PictureLoop(self._profile, self._modes, self._painter, depth, self._timing, channels)
            if channels
            else None
        )

    @property
    def profile(self) -> VideoProfile:
        """Profile in use."""
        return self._profile

    def process(self, luma: Luma) -> list[Luma]:
        """Take the next frame; return those that are ready, 0.6 s later or, with `channels`, more.

        Parameters
        ----------
        luma : ndarray of uint8 or uint16, shape (height, width)
            Samples of the picture; kept until put out, so do not change them.

        Returns
        -------
        list of ndarray
            Marked frames of the same shape and type, in order.

        Raises
        ------
        CueError
            If the frame has another size than announced.
        """
        if luma.shape != self._grid.shape:
            raise CueError(f"frame of shape {luma.shape}: expected {self._grid.shape}")
        self._writer.add_frame(luma)
        design = self._analyse(luma)
        if design is not None:
            self._designs.append(design)
            if self._loop is None:
                self._paint(fixed_strength(design.place, self._grid.shape))
        if self._loop is not None:
            for strength in self._loop.process(luma, design):
                self._paint(strength)
        return self._writer.ready()

    def flush(self) -> list[Luma]:
        """Return the frames that are still waiting; an incomplete superframe stays unmarked.

        Returns
        -------
        list of ndarray
        """
        if self._loop is not None:
            for strength in self._loop.flush():
                self._paint(strength)
        return self._writer.end()

    def report(self) -> VideoReport:
        """Return a report on the frames so far.

        Returns
        -------
        VideoReport
        """
        sent = self._writer.sent
        pixels = max(1, sent) * self._grid.shape[0] * self._grid.shape[1]
        mean_square = self._writer.squares / pixels / self._grid.largest**2
        psnr_db = float("inf") if mean_square == 0 else float(-10 * np.log10(mean_square))
        rates = self._profile.net_bps, self._profile.gross_bps
        return VideoReport(sent, self._superframes, psnr_db, *rates, tuple(self._steps), self._lone)

    def _analyse(self, luma: Luma) -> Design | None:
        """Add a frame to its superframe's window; return the design that it completes."""
        k = self._superframes
        start, window = self._timing.window_start(k), self._timing.window
        if start <= self._received < start + window:
            amplitudes = self._grid.project(luma)
            self._sum += amplitudes
            self._energy += np.sum(amplitudes**2, axis=0)
            if self._received % TEXTURE_EVERY == 0:
                self._textures.append(self._grid.texture(luma))
        self._received += 1
        if self._received < start + window:
            return None
        texture = np.mean(self._textures, axis=0) if self._textures else np.zeros((ROWS, COLUMNS))
        l0, l1 = checked_payload(self._source, k, self._profile)
        coded, lone = self._modes[0].link.encode(l0, l1), self._modes[-1].link.encode(l0, b"")
        design = Design(k, self._sum / window, self._energy / window, texture, coded, lone)
        self._sum[:] = self._energy[:] = 0
        self._textures.clear()
        self._superframes += 1
        return design

    def _paint(self, strength: Strength) -> None:
        """Give the oldest design its strength."""
        self._steps[strength.rung] += 1
        self._lone += strength.lone
        design = self._designs.popleft()
        moves = design.moves(self._modes, strength)
        self._writer.add_pattern(self._painter.paint(moves, design.smooth))
