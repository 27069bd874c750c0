"""Mark a picture: frames in, the same frames with superframes inside out.

Each superframe is one pattern, constant between fades; its amplitudes move the mean projection of
every cell over the superframe onto the lattice point of the cell's bit. Specification:
spec/video-carrier.md.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from watermark.link.inputs import checked_payload
from watermark.video import _kernels
from watermark.video.grid import Grid
from watermark.video.modes import make_modes
from watermark.video.profile import (
    COARSE,
    COLUMNS,
    FADE,
    POSITIONS,
    ROWS,
    TEMPLATES,
    TEXTURE,
    VideoProfile,
    find_profile,
)
from watermark.video.timing import Timing

TEXTURE_EVERY = 4
"""Frames between those whose texture is measured."""

NOMINAL = 16, 235
"""Black and white of luma of 8 bits (ITU-R BT.709): no pixel is moved out of that range."""

SMALL_CELL = 80.0
"""Pixels of a cell below which every superframe has the next wider step: in cells of 8 by 8, one
block of a coder, MPEG-2 at 4 Mbit/s takes a quarter of the fine bits otherwise."""

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
    """

    frames: int
    superframes: int
    psnr_db: float
    net_bps: float
    gross_bps: float


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

    Raises
    ------
    CueError
        If size, rate, depth, strength, profile or key are out of range.
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
    ) -> None:
        if not 0.2 <= strength <= 8:
            raise CueError(f"strength {strength}: must be 0.2..8")
        self._grid = Grid(width, height, depth)
        self._timing = Timing(Fraction(fps))
        self._profile = find_profile(profile)
        self._modes = make_modes(self._profile, key, strength)
        self._source = source
        self._waiting: deque[Luma] = deque()
        self._received = self._sent = self._superframes = 0
        self._sum = np.zeros((TEMPLATES, ROWS, COLUMNS))
        self._textures: list[FloatArray] = []
        nothing = np.zeros((height, width), dtype=np.float32)
        self._patterns: deque[NDArray[np.float32]] = deque([nothing])
        self._nothing = nothing
        self._first_pattern = -1  # superframe of the first pattern in the queue
        self._squares = 0.0
        self._unit = 2.0 ** (depth - 8)
        self._rung = int(width * height < SMALL_CELL * ROWS * COLUMNS)

    @property
    def profile(self) -> VideoProfile:
        """Profile in use."""
        return self._profile

    def process(self, luma: Luma) -> list[Luma]:
        """Take the next frame; return those that are ready, about 0.6 s later.

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
        k = self._first_pattern + len(self._patterns)
        start = self._timing.window_start(k)
        if start <= self._received < start + self._timing.window:
            self._sum += self._grid.project(luma)
            if self._received % TEXTURE_EVERY == 0:
                self._textures.append(self._grid.texture(luma))
        self._waiting.append(luma)
        self._received += 1
        if self._received == start + self._timing.window:
            self._patterns.append(self._pattern(k, self._sum / self._timing.window))
            if k == 0:
                # Nothing to fade from, and much is predicted from a programme's first frame.
                self._patterns[0] = self._patterns[1]
            self._sum[:] = 0
            self._textures.clear()
            self._superframes += 1
        return self._put_out(self._first_pattern + len(self._patterns))

    def flush(self) -> list[Luma]:
        """Return the frames that are still waiting; an incomplete superframe stays unmarked.

        Returns
        -------
        list of ndarray
        """
        self._patterns.extend([self._nothing, self._nothing])
        return self._put_out(self._first_pattern + len(self._patterns))

    def report(self) -> VideoReport:
        """Return a report on the frames so far.

        Returns
        -------
        VideoReport
        """
        pixels = max(1, self._sent) * self._nothing.size
        mean_square = self._squares / pixels / self._grid.largest**2
        psnr_db = float("inf") if mean_square == 0 else float(-10 * np.log10(mean_square))
        rates = self._profile.net_bps, self._profile.gross_bps
        return VideoReport(self._sent, self._superframes, psnr_db, *rates)

    def _pattern(self, k: int, host: FloatArray) -> NDArray[np.float32]:
        """Pattern that moves the mean amplitudes `host` onto superframe k's lattice points."""
        # The rate control of coders starts poor.
        mode = self._modes[min(self._rung + (k == 0), len(self._modes) - 1)]
        layout = mode.layout
        bits = np.empty(POSITIONS, dtype=np.int64)
        bits[layout.pilots] = layout.pilot_bits ^ (k & 1)
        bits[layout.data] = mode.link.encode(*checked_payload(self._source, k, self._profile))
        spread = np.ones((ROWS, COLUMNS))
        if self._textures:
            spread[np.mean(self._textures, axis=0) > TEXTURE] = COARSE
        offset = layout.dither.reshape(host.shape) + spread * bits.reshape(host.shape) / 2
        place = (host / mode.step - offset) / spread
        move = (np.round(place) - place) * spread * mode.step
        return self._grid.paint(move)

    def _put_out(self, known: int) -> list[Luma]:
        """Mark the waiting frames whose patterns up to superframe `known` - 1 exist."""
        ready: list[Luma] = []
        while self._waiting:
            k, phase = self._timing.phase(self._sent)
            ramp = FADE / 2
            other = k - 1 if phase < ramp else k + 1 if phase > 1 - ramp else k
            if max(k, other) >= known:
                break
            while self._first_pattern < min(k, other) and len(self._patterns) > 1:
                self._patterns.popleft()
                self._first_pattern += 1
            weight = 0.5 * max(0.0, 1 - min(phase, 1 - phase) / ramp)
            ready.append(self._mark(self._waiting.popleft(), k, other, weight))
            self._sent += 1
        return ready

    def _mark(self, luma: Luma, k: int, other: int, weight: float) -> Luma:
        first, second = (self._patterns[i - self._first_pattern] for i in (k, other))
        out = np.empty_like(luma)
        weight *= first is not second  # exactly the same, so that a beginning stays still
        black, white = (level * self._unit for level in NOMINAL)
        _kernels.add_into(luma, first, second, weight, black, white, out)
        difference = out.astype(np.float32) - luma
        self._squares += float(np.vdot(difference, difference))
        return out
