"""Packets of a programme's sound become samples on one unbroken line of time.

Gaps between packets (lost or damaged ones, a sound that pauses) are filled with silence and
overlaps are cut, so that sample n stands at ``start_s + n / fs`` throughout.
"""

import os
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from receiver.media.programme import Programme, SoundFormat, open_programme, reason
from watermark.audio.signal.mix import RATES, check_format
from watermark.quality.resample import Resampler

JITTER_S = 0.010
"""Timestamps that stray by less are rounding of the container (1 ms in Matroska)."""

LONGEST_GAP_S = 10.0
"""A greater step is a new start of the container's clock, not a pause: the line goes on."""


_FILLED_S, _FILLED_SHARE = 60.0, 25.0
"""Silence that gaps may be filled with: a minute, and this multiple of the decoded sound. Sounds
that pause send a packet of 20 ms in 0.4 s; a file with more gaps than that is made to cost time."""

_MOST_PLANES = 8
"""PyAV (18, 19) reads beyond the list of a frame's planes where it has this many."""

_CONVERTED_RATE = 48_000
"""Rate in Hz to which sounds are brought whose own rate the carrier does not know."""


class SoundDecoder:
    """Decoder of one sound of a programme.

    Parameters
    ----------
    programme : Programme
        Its `sound` is decoded.
    strict : bool
        Whether a damaged packet within the sound is an error; otherwise it counts in `damaged`
        and is a gap. Packets before the first whole one always do: a recording that was cut out
        of a broadcast begins in the middle of a frame.

    Attributes
    ----------
    format : SoundFormat
        Parameters of the samples that come out.
    start_s : float or None
        Time of the first sample on the programme's clock, once there is one.
    container_start_s : float
        The same time as the container counts.
    samples : int
        Samples given so far.
    damaged : int
        Packets that could not be decoded.
    """

    def __init__(self, programme: Programme, *, strict: bool) -> None:
        self._programme = programme
        self._strict = strict
        self._converter: av.AudioResampler | None = None
        self._offset = self._filled = 0
        self.format: SoundFormat = programme.format
        self.start_s: float | None = None
        self.container_start_s = 0.0
        self.samples = 0
        self.damaged = 0

    def process(self, packet: Any) -> NDArray[np.float32]:
        """Decode one packet of the sound (None: the last ones in the decoder).

        Returns
        -------
        ndarray of float32, shape (n, channels)
            Full scale is 1; n may be 0.

        Raises
        ------
        CueError
            If the decoder is strict and the packet is damaged, or was the last and none was whole.
        """
        name = self._programme.name
        try:
            frames = self._programme.sound.decode(packet)
        except av.FFmpegError as error:
            self._note_damage(error)
            frames = []
        if packet is None and self._strict and self.damaged and not self.samples and not frames:
            raise CueError(f"{name}: damaged sound: none of it could be decoded")
        blocks = [self._placed(frame) for frame in frames if frame.samples]
        if not blocks:
            return np.zeros((0, self.format.channels), np.float32)
        return np.concatenate(blocks)

    def flush(self) -> NDArray[np.float32]:
        """Return the samples that were still in the decoder."""
        return self.process(None)

    def _placed(self, frame: av.AudioFrame) -> NDArray[np.float32]:
        block = self._samples(frame)
        fs = self.format.fs
        position = (
            None if frame.pts is None else float(frame.pts * (frame.time_base or Fraction(1)))
        )
        if self.start_s is None:
            self.container_start_s = position or 0.0
            self.start_s = self.container_start_s - self._programme.origin_s
        elif position is not None:
            due = round((position - self.container_start_s) * fs) - self._offset
            block = self._aligned(block, due - self.samples)
        self.samples += len(block)
        return block

    def _aligned(self, block: NDArray[np.float32], late: int) -> NDArray[np.float32]:
        """Fill or cut `late` samples between the last block and the next."""
        fs = self.format.fs
        if abs(late) <= JITTER_S * fs:
            return block
        if late < 0 and late >= -LONGEST_GAP_S * fs:
            return block[-late:]
        decoded = self.samples - self._filled
        most = min(LONGEST_GAP_S * fs, _FILLED_S * fs + _FILLED_SHARE * decoded - self._filled)
        if not 0 <= late <= most:
            self._offset += late
            return block
        self._filled += late
        return np.concatenate([np.zeros((late, block.shape[1]), np.float32), block])

    def _note_damage(self, error: Exception) -> None:
        if self._strict and self.samples:
            at = f"{self.samples / self.format.fs:.2f} s"
            raise CueError(
                f"{self._programme.name}: damaged sound at {at}: {reason(error)}"
            ) from error
        self.damaged += 1

    def _samples(self, frame: av.AudioFrame) -> NDArray[np.float32]:
        """Return the frame's samples, in this decoder's rate and channels."""
        fmt = self.format
        same = frame.sample_rate == fmt.fs and frame.layout.nb_channels == fmt.channels
        if same and not (frame.format.is_planar and fmt.channels >= _MOST_PLANES):
            return as_float(frame)
        for _ in range(2):  # the converter may be one for the frames of before
            if (
                self._converter is None
            ):  # the programme changed between stereo and surround, or rate
                self._converter = av.AudioResampler(format="flt", layout=fmt.layout, rate=fmt.fs)
            try:
                frames = self._converter.resample(frame)
                break
            except (ValueError, av.FFmpegError) as error:
                self._converter, failure = None, error
        else:
            self._note_damage(failure)
            frames = []
        blocks = [as_float(converted) for converted in frames]
        return np.concatenate(blocks) if blocks else np.zeros((0, fmt.channels), np.float32)


def as_float(frame: av.AudioFrame) -> NDArray[np.float32]:
    """Return the samples of `frame` as float32, shape (n, channels), full scale 1.

    Examples
    --------
    >>> frame = av.AudioFrame.from_ndarray(np.array([[-32768, 16384]], np.int16), layout="stereo")
    >>> as_float(frame).tolist()
    [[-1.0, 0.5]]
    """
    raw = frame.to_ndarray()
    x = raw.T if frame.format.is_planar else raw.reshape(-1, frame.layout.nb_channels)
    if x.dtype.kind == "f":
        return np.ascontiguousarray(x, np.float32)
    if x.dtype.kind == "u":
        return ((x.astype(np.float32) - 128) / 128).astype(np.float32)
    return (x / float(1 << (8 * x.dtype.itemsize - 1))).astype(np.float32)


class CarrierSound:
    """The sound of a programme at a rate for which the carrier is defined.

    Parameters
    ----------
    programme : Programme

    Raises
    ------
    CueError
        If the sound is of a kind that cannot carry a cuer.
    """

    def __init__(self, programme: Programme) -> None:
        sound = programme.format
        if sound.fs < min(RATES):
            raise CueError(
                f"{programme.name}: sound of {sound.fs} Hz cannot carry a cuer, at least "
                f"{min(RATES)} Hz can"
            )
        self.rate = sound.fs if sound.fs in RATES else _CONVERTED_RATE
        self.channels = sound.channels
        try:
            check_format(self.rate, self.channels)
        except CueError as error:
            raise CueError(f"{programme.name}: {error}") from error
        self._resampler = Resampler(sound.fs, self.rate, sound.channels)

    def process(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take samples at the programme's rate, (n, channels); give them at `rate`."""
        return self._resampler.process(block.astype(np.float64)).astype(np.float32)

    def flush(self) -> NDArray[np.float32]:
        """Give the rest."""
        return self._resampler.flush().astype(np.float32)


def sound_blocks(decoder: SoundDecoder, programme: Programme) -> Iterator[NDArray[np.float32]]:
    """Yield the whole sound of `programme` block by block, as it is read."""
    for packet in programme.packets():
        if packet.stream is programme.sound:
            block = decoder.process(packet)
            if len(block):
                yield block
    block = decoder.flush()
    if len(block):
        yield block


def read_sound(path: str | os.PathLike[str], *, track: int = 0) -> tuple[NDArray[np.float32], int]:
    """Return the whole sound of a short programme, shape (n, channels), and its rate in Hz.

    Raises
    ------
    CueError
        If the programme is malformed or its sound damaged.
    """
    with open_programme(path, track=track) as programme:
        decoder = SoundDecoder(programme, strict=True)
        blocks = list(sound_blocks(decoder, programme))
    if not blocks:
        raise CueError(f"{path}: its sound is empty")
    return np.concatenate(blocks), decoder.format.fs
