"""The last seconds of all channels, and mixes of them, at any speed.

In: blocks of samples; out: a mix, appended to a tape that is followed, or a stretch of one that is
searched again and again. Memory: `forget` bounds it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from watermark.audio.search.channel_mixes import ChannelMix
from watermark.audio.search.pilot_scan import DECIMATION, LOW_REACH, Sight, see_stretch
from watermark.audio.signal.profile import FS
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer


class Stretch:
    """A mix that is searched again and again, as it is and as the search's sound.

    Parameters
    ----------
    tape : StereoBuffer
        The mix and its side.
    nominal : float
        Samples that come for one of the mark's own at its usual speed.
    first : float, optional
        Where the stretch begins, where the tape holds more; it ends with the tape.
    seen : Sight, optional
        Its sight at its usual speed, where the usual search has looked at it.

    Attributes
    ----------
    first, end : float
        Where it begins and ends.
    """

    def __init__(
        self,
        tape: StereoBuffer,
        nominal: float,
        first: float | None = None,
        seen: Sight | None = None,
    ) -> None:
        self.tape, self._low, self._seen = tape, SampleBuffer(kind=np.float32), seen
        self.first, self.end = tape.first if first is None else first, tape.end
        self._step = DECIMATION * nominal

    def see(self, key: int, speed: float, seconds: float) -> Sight:
        """Look at the first seconds as if they came at some speed."""
        if self._seen is not None and speed == 1.0:
            return self._seen
        return see_stretch(key, self.low(speed, seconds))

    def low(self, speed: float, seconds: float) -> NDArray[np.float32]:
        """Return the first seconds at the search's rate, as if they came at some speed."""
        if not self._low.end:
            count = int((self.end - self.first) / self._step)
            self._low.append(self.tape.read(self.first, self._step, count, LOW_REACH))
        count = min(int(seconds * FS / DECIMATION), self._low.end)
        return self._low.read(0.0, speed, int(count / speed), LOW_REACH)


class SoundRing:
    """Channels as they arrive.

    Parameters
    ----------
    channels : int
        How many.
    nominal : float
        Samples that come for one of the mark's own.
    """

    def __init__(self, channels: int, nominal: float) -> None:
        self._sounds = [SampleBuffer(kind=np.float32) for _ in range(channels)]
        self._nominal = nominal
        self._kept: tuple[ChannelMix, int, Stretch] | None = None

    @property
    def first(self) -> int:
        """The oldest sample that is remembered."""
        return self._sounds[0].first

    @property
    def end(self) -> int:
        """The number of samples that have arrived."""
        return self._sounds[0].end

    def append(self, block: NDArray[np.float32]) -> None:
        """Add samples, shape (n, channels)."""
        for sound, channel in zip(self._sounds, block.T, strict=True):
            sound.append(channel)

    def forget(self, before: int) -> None:
        """Drop all samples with an index below `before`."""
        for sound in self._sounds:
            sound.forget(before)

    def read(self, start: int, count: int) -> NDArray[np.float32]:
        """Return all channels, shape (count, channels)."""
        # Channel by channel in memory, too: numpy takes ten times as long to interleave them.
        return np.array([sound.part(start, count) for sound in self._sounds]).T

    def extend(self, tape: StereoBuffer, mix: ChannelMix, now: int) -> None:
        """Append the known part of a mix to a sample buffer at a time."""
        skew = mix.skew
        known = now - (math.ceil(abs(skew)) + tape.reach(1.0) if skew else 0)
        if known > tape.end:
            self._append(tape, mix, known - tape.end)

    def stretch(
        self, mix: ChannelMix, start: int, count: int, known: StereoBuffer | None = None
    ) -> Stretch:
        """Return a mix from `start` on; the last one is kept. `known` is its tape if there is one.

        That one must hold all from `start` to its end, `count` samples later.
        """
        if self._kept is None or self._kept[:2] != (mix, start):
            tape = known
            if tape is None:
                tape = StereoBuffer(start, np.float32)
                self._append(tape, mix, count)
            self._kept = mix, start, Stretch(tape, self._nominal, start)
        return self._kept[2]

    def _append(self, tape: StereoBuffer, mix: ChannelMix, count: int) -> None:
        """Append a mix, and its rest."""
        start, (late, own, aside) = tape.end, mix.echo
        sound, beside = tape.grow(count), tape.side.grow(count)
        parts = self._parts(mix, start, count)
        if mix.side is None:
            beside[:] = 0.0
        else:
            np.subtract(parts[0], parts[1], out=beside)
        np.add(parts[0], parts[1] if len(parts) > 1 else np.float32(0), out=sound)
        for part in parts[2:]:
            sound += part
        for first in range(0, count if late else 0, late or 1):
            cut = slice(first, first + late)
            before, size = start + first - late, sound[cut].size
            sound[cut] -= np.float32(own) * tape.read(before, 1.0, size)
            beside[cut] -= np.float32(aside) * tape.side.read(before, 1.0, size)

    def _parts(self, mix: ChannelMix, start: int, count: int) -> list[NDArray[np.float32]]:
        """Return what each channel of some weight adds to a mix."""
        known = self.first <= start and start + count <= self.end
        parts = []
        for channel, (weight, sound) in enumerate(zip(mix.weights, self._sounds, strict=True)):
            skew = mix.skew if channel == 1 else 0.0
            if weight and known and not skew:
                parts.append(np.float32(weight) * sound.view(start, count))
            elif weight:
                parts.append(np.float32(weight) * sound.read(start + skew, 1.0, count))
        return parts or [np.zeros(count, dtype=np.float32)]
