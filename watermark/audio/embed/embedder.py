"""The audio embedder: a programme in blocks in, the same programme with its mark out.

The mark of each superframe is designed on the programme's mid, of two channels on mid and side, at
the level that gives the wanted grade, and added to its front channels.
Specification: spec/audio-carrier.md, W5 to W7, W20 and W21.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from watermark.audio.embed.codec_loop import MARGIN, CodecLoop
from watermark.audio.embed.design import HostSpectra, MarkDesigner
from watermark.audio.embed.graded_passage import PASSAGE
from watermark.audio.embed.level_control import QUIETEST, LevelControl
from watermark.audio.embed.levels import (
    EQUALISATION,
    HIGHEST_LEVEL,
    LEVELS_PER_DOUBLING,
    NEUTRAL_NEED,
    bounded_level,
    level_of,
)
from watermark.audio.embed.multichannel import MarkShares
from watermark.audio.embed.report import EmbedReport, SuperframeMargin, spans_of
from watermark.audio.embed.stereo_design import StereoDesigner, leaning_of
from watermark.audio.signal.mix import add_mark, check_format, front_of, mid_of, side_of
from watermark.audio.signal.profile import FS, HOP, SUPERFRAME, find_profile
from watermark.audio.signal.sample_buffer import SampleBuffer
from watermark.link.inputs import checked_block, checked_payload
from watermark.link.superframe import SUPERFRAME_S

STRETCH = 4
"""Superframes that are graded together: the embedder looks this far ahead."""

MEASURED = 0.2
"""Standard deviation of the level that a rehearsal finds, in levels: information that is measured
on a superframe's cells errs by some 8 %. Through AAC, whose rate control goes another way with each
payload, it errs by 20 to 25 %; 0.45 neither lost nor saved superframes of twelve clips."""

LEAST_MARGIN = 1.5
"""Information in units of the message's and its checks' bits to which superframes are lowered where
their passage has no grade left for `MARGIN`: below 1.1 some fail, below 0.7 most, and one that AAC
codes again with another payload has 15 % more or less (standard deviation)."""

EASE = LEVELS_PER_DOUBLING * math.log2(MARGIN / 1.8)
"""Most levels that passages with grade to spare may stand below `MARGIN`: aiming at 1.8 times the
needed information throughout lost none of 2232 superframes of twelve clips and sounds better, but
6 of 186 of a clip whose grade is short; with this it lost 2."""

SPARED = 3.0
"""How fast superframes that have more than enough give way where the grade is short: at a third of
what all may lack they do as the others. With 1 a clip whose grade is short lost 4 of 124."""

MOST_LOWERED = LEVELS_PER_DOUBLING * math.log2(MARGIN / LEAST_MARGIN)
"""The same in levels."""

FIRST_BASE = 5.5
"""Base level of the first rehearsal: what suffices as a rule."""

SHORT = (0.5, -0.25)
"""Levels that a passage of two channels lacks at least so that all its cells are written in the
mid, the part that coders keep best, and again in left and right, for who hears one channel only."""

REPORTED = 100_000
"""Superframes whose margins are kept for the report, 17 h."""

Source = Callable[[int], tuple[bytes, bytes]]
"""Payloads (L0, L1) of the superframe on air from programme time k * 0.64 s."""


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Some superframes written at one level.

    Attributes
    ----------
    clean, marked : ndarray of float64, shape (n, 1 or 2)
        The programme's front without and with marks, for grading.
    mark : ndarray of float64, shape (n,)
        The mark added to the mid.
    end, tail : ndarray of float64, shape (rows, HOP)
        The last designed samples (mid; of two channels, mid and side), and the part of
        the last superframe's mark that lies beyond.
    divided : ndarray of float64, shape (2, n + HOP)
        See `MarkShares.divide`.
    silent : tuple of bool
        For each superframe, whether it cannot carry.
    levels : list of float, or None
        Their levels; None where nothing was written.
    """

    clean: NDArray[np.float64]
    marked: NDArray[np.float64]
    mark: NDArray[np.float64]
    end: NDArray[np.float64]
    tail: NDArray[np.float64]
    divided: NDArray[np.float64]
    silent: tuple[bool, ...]
    levels: list[float] | None


class AudioEmbedder:
    """Writes superframes into a programme, block by block.

    Samples come out 2.57 s to 5.13 s after they went in, in their old places; 2.56 s later with a
    rehearsal.

    Parameters
    ----------
    fs : int
        Rate of the programme in Hz: 32000, 44100 or 48000.
    channels : int
        1 to 6: front left, front right, centre, LFE (six only), surround left, surround right.
    source : callable
        Gives the payloads (L0, L1) of superframe k, on air from k * 0.64 s.
    profile : str
        Name of a `Profile`.
    grade : float, optional
        Objective difference grade to aim at (ITU-R BS.1387), the profile's own by default:
        0 imperceptible, -1 perceptible but not annoying. The level of the mark follows it; with a
        rehearsal it is the lowest grade, of passages that need it, and others have a better one.
    level : int, optional
        Fixed level instead, see `watermark.audio.signal.profile.LEVELS`.
    key : int
        Seed of the layout, 0 to 2**64 - 1; the receiver needs the same.
    rehearsal : CodecLoop, optional
        A coder for trying superframes first, of profile and key as here; not at a fixed
        level.
    stretch : int
        Superframes that are graded together, from 1: the embedder looks this far ahead.

    Raises
    ------
    CueError
        If the format cannot be marked.

    Examples
    --------
    >>> embedder = AudioEmbedder(48000, 1, lambda k: (bytes(20), bytes(7)))
    >>> noise = np.random.default_rng(0).normal(0, 0.1, (48000, 1)).astype(np.float32)
    >>> out = np.concatenate([embedder.process(noise), embedder.flush()])
    >>> out.shape
    (48000, 1)
    """

    def __init__(
        self,
        fs: int,
        channels: int,
        source: Source,
        *,
        profile: str = "standard",
        grade: float | None = None,
        level: int | None = None,
        key: int = 0,
        rehearsal: CodecLoop | None = None,
        stretch: int = STRETCH,
    ) -> None:
        check_format(fs, channels)
        self._fs, self._channels, self._source = fs, channels, source
        self._profile = find_profile(profile)
        self._rows = 2 if channels == 2 else 1
        designer = StereoDesigner if channels == 2 else MarkDesigner
        self._designer = designer(self._profile, key)
        self._front = min(channels, 2)
        wanted = self._profile.grade if grade is None else grade
        # A given level leaves nothing to control or to try on a coder.
        control = LevelControl(wanted, self._front, quiet=rehearsal is not None)
        self._control = control if level is None else None
        self._rehearsal = rehearsal if level is None else None
        self._stretch_length = stretch
        # With a codec in the loop, the stretch after this one is tried before this one is written.
        self._ahead = stretch if self._rehearsal else 0
        # Of the superframes from the next one on that were looked at: clean spectra and need.
        self._looked: dict[int, tuple[HostSpectra, float]] = {}
        self._enough: deque[float] = deque(maxlen=PASSAGE // 2 * STRETCH)
        self._level = level or 0
        self._apart = self._control is None
        self._programme: list[NDArray[np.float64]] = []
        self._waiting = 0
        self._given = 0
        self._host = SampleBuffer()
        self._side = SampleBuffer()
        self._mark = SampleBuffer()
        self._shares = MarkShares(channels)
        self._across, self._taken = SampleBuffer(), SampleBuffer()
        # Of each row (mid, side): the hop before the next superframe, and the end of the last one's
        # mark, which overlaps it.
        self._before = np.zeros((self._rows, HOP))
        self._tail = np.zeros((self._rows, HOP))
        self._next = 0
        self._host_power = self._mark_power = 0.0
        self._silent: list[int] = []
        self._margins: deque[SuperframeMargin] = deque(maxlen=REPORTED)

    def process(self, block: NDArray[np.float32]) -> NDArray[np.float32]:
        """Take samples and return those that are finished.

        Parameters
        ----------
        block : ndarray of float32, shape (n, channels)
            The next samples of the programme, of full scale 1; any n.

        Returns
        -------
        ndarray of float32, shape (m, channels)
            Marked samples, in order and without gaps.
        """
        x = checked_block(block, self._channels)
        self._programme.append(np.array(x))  # the caller may use his block again
        self._waiting += len(x)
        self._host.append(mid_of(x))
        self._side.append(side_of(x))
        self._shares.append(x)
        ratio = self._fs / FS
        margin = self._host.reach(ratio)
        wanted = (self._stretch_length + self._ahead) * SUPERFRAME + HOP
        while (self._next * SUPERFRAME + wanted) * ratio + margin <= self._host.end:
            self._rehearse(self._next + self._ahead + self._stretch_length)
            self._write_next(self._stretch_length)
        return self._take(self._finished())

    def flush(self) -> NDArray[np.float32]:
        """Return the rest, so that as many samples have come out as went in.

        Returns
        -------
        ndarray of float32, shape (m, channels)
        """
        total = self._given + self._waiting
        needed = math.ceil(total / self._fs / SUPERFRAME_S)
        self._rehearse(needed)
        if self._rehearsal is not None:
            self._rehearsal.end()
        while self._next < needed:
            self._write_next(min(self._stretch_length, needed - self._next))
        whole = int(total / self._fs / SUPERFRAME_S + 1e-6)
        if self._margins and self._margins[-1].number >= whole:
            # The sound's end cuts it off: nobody receives it.
            self._margins.pop()
        for tape in (self._mark, self._across, self._taken):
            tape.append(np.zeros(FS // 10))
        return self._take(self._waiting)

    def report(self) -> EmbedReport:
        """Return figures of all that was handed out.

        Returns
        -------
        EmbedReport
        """
        snr_db = None
        if self._mark_power:
            snr_db = float(10 * np.log10(self._host_power / self._mark_power))
        return EmbedReport(
            duration_s=self._given / self._fs,
            superframes=self._next - len(self._silent),
            snr_db=snr_db,
            odg=None if self._control is None else self._control.grade,
            silent_s=spans_of(self._silent),
            net_bps=self._profile.net_bps,
            gross_bps=self._profile.gross_bps,
        )

    def margins(self) -> tuple[SuperframeMargin, ...]:
        """Return the margins of the written superframes, of a rehearsed mark and where known.

        Returns
        -------
        tuple of SuperframeMargin
            In order, of the last `REPORTED` superframes; without one that the end cuts off.
        """
        return tuple(self._margins)

    def _write_next(self, count: int) -> None:
        """Write the next superframes, at the level that gives the wanted grade."""
        numbers = range(self._next, self._next + count)
        ratio = self._fs / FS
        start = self._next * SUPERFRAME * ratio
        sound = np.stack(self._sound(self._next, count))
        clean = front_of(sound[0, :-HOP], sound[1, :-HOP], self._front)
        self._shares.begin(start, ratio, count * SUPERFRAME)
        payloads = [checked_payload(self._source, k, self._profile) for k in numbers]
        if self._control is None:
            made = self._stretch(sound, clean, payloads, [self._level] * count)
        else:
            needs = [self._look(k)[1] for k in numbers]
            enough = [self._sufficient(k, need) for k, need in zip(numbers, needs, strict=True)]
            control, sufficient = self._control, self._sufficient_base()
            lowered = MOST_LOWERED + control.overdrawn
            floor, spare = -math.inf, 1.0
            if sufficient is not None:
                if self._next:
                    self._apart = control.lack(sufficient) < SHORT[0 if self._apart else 1]
                floor = sufficient - lowered
                spare = min(max(1.0 - SPARED * (sufficient - control.base) / lowered, 0.0), 1.0)

            last: _Stretch | None = None

            def attempt(base: float | None) -> _Stretch:
                nonlocal last
                levels = None
                if base is not None:
                    levels = [level_of(base, need) for need in needs]
                    if sufficient is not None and base != QUIETEST:
                        above = max(control.base, floor) - sufficient + base - control.base
                        levels = [
                            plain
                            if least is None
                            else bounded_level(
                                least + above + spare * max(plain - least - above, 0.0), base
                            )
                            for plain, least in zip(levels, enough, strict=True)
                        ]
                # Loud passages have the highest level, soft ones the lowest, at many bases.
                if last is None or last.levels != levels:
                    last = self._stretch(sound, clean, payloads, levels)
                return last

            made = control.settle(attempt, enough=sufficient, least=floor)
            if not self._next and (sufficient is None or control.lack(sufficient) < SHORT[1]):
                # Whether the grade suffices is known by now: what was settled, written apart.
                self._apart = True
                made = self._stretch(sound, clean, payloads, made.levels)
            if sufficient is not None:
                control.strive(sufficient - EASE - control.base)
        self._before, self._tail = made.end, made.tail
        self._mark.append(made.mark)
        across, taken = self._shares.settle(made.divided)
        self._across.append(across)
        self._taken.append(taken)
        self._silent += [k for k, silent in zip(numbers, made.silent, strict=True) if silent]
        self._note_margins(made)
        for k in numbers:
            self._looked.pop(k, None)
        self._next += count
        done = int((self._next * SUPERFRAME - HOP) * ratio) - 2 * self._host.reach(ratio)
        for tape in (self._host, self._side):
            tape.forget(done)
        self._shares.forget(done)

    def _note_margins(self, made: _Stretch) -> None:
        """Keep the margins of a stretch."""
        if self._rehearsal is None or made.levels is None:
            return
        for i, level in enumerate(made.levels):
            number = self._next + i
            found = self._rehearsal.margin(number, level)
            if found is not None and not made.silent[i]:
                loudest = level >= HIGHEST_LEVEL
                self._margins.append(SuperframeMargin(number, *found, loudest))

    def _rehearse(self, end: int) -> None:
        """Try the superframes up to a number on the coder."""
        if self._rehearsal is None or self._control is None:
            return
        while (first := self._rehearsal.count) < end:
            count = min(self._stretch_length, end - first)
            looked = [self._look(k) for k in range(first, first + count)]
            base = self._control.base if self._enough else FIRST_BASE
            self._rehearsal.send(
                *self._sound(first, count),
                [level_of(base, need) for _, need in looked],
                apart=self._rows == 2 and self._apart,
                clean=[spectra for spectra, _ in looked],
            )

    def _sufficient_base(self) -> float | None:
        """Return the base level that suffices for half a passage, None if unknown."""
        return float(np.median(self._enough)) if self._enough else None

    def _sufficient(self, number: int, need: float) -> float | None:
        """Level that suffices for a superframe by its rehearsal, None if unknown.

        A measurement errs: what of the passage's scatter is more than that is believed. Source:
        James and Stein, "Estimation with quadratic loss", 1961.
        """
        level = None if self._rehearsal is None else self._rehearsal.enough(number)
        if level is None:
            return None
        extra = EQUALISATION * (need - NEUTRAL_NEED)
        self._enough.append(level - extra)
        usual = float(np.median(self._enough)) + extra
        scatter = max(float(np.var(self._enough)), MEASURED**2)
        return usual + (1 - MEASURED**2 / scatter) * (level - usual)

    def _look(self, number: int) -> tuple[HostSpectra, float]:
        """Spectra of a superframe without its mark, and the level that it needs."""
        if number not in self._looked:
            spectra = self._designer.spectra_of(*self._sound(number, 1, before=HOP))
            self._looked[number] = spectra, self._designer.need(spectra)
        return self._looked[number]

    def _sound(
        self, first: int, count: int, *, before: int = 0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mid and side of some superframes, the `HOP` samples after and `before` them included."""
        ratio = self._fs / FS
        start, length = (first * SUPERFRAME - before) * ratio, before + count * SUPERFRAME + HOP
        return self._host.read(start, ratio, length), self._side.read(start, ratio, length)

    def _stretch(
        self,
        sound: NDArray[np.float64],
        clean: NDArray[np.float64],
        payloads: list[tuple[bytes, bytes]],
        levels: list[float] | None,
    ) -> _Stretch:
        """Write superframes, or none, into mid and side, (2, superframes * SUPERFRAME + HOP).

        `clean` is their front without the hop beyond.
        """
        host = sound[: self._rows]
        marked = host.copy()
        marked[:, :HOP] += self._tail
        # Superframes overlap by a hop: each is designed on the sound that has its predecessor's
        # mark already.
        before, silent = self._before, [True] * len(payloads)
        if levels is not None:
            for i, (payload, level) in enumerate(zip(payloads, levels, strict=True)):
                span = slice(i * SUPERFRAME, (i + 1) * SUPERFRAME + HOP)
                leaning = leaning_of(self._next + i) if self._apart else None
                seen = self._looked.get(self._next + i)
                made = self._designer.design(
                    before,
                    marked[:, span],
                    payload,
                    level,
                    leaning=leaning,
                    clean=None if seen is None else seen[0],
                )
                marked[:, span] += made.mark
                before = marked[:, (i + 1) * SUPERFRAME - HOP : (i + 1) * SUPERFRAME]
                silent[i] = not made.carries
        mark = marked - host
        # Row 0 of `divided` is what left has more of than mid, and right less: the side's own mark
        # adds to it.
        divided = self._shares.divide(mark[0])
        if self._rows == 2:
            divided[0] += mark[1]
        inner = slice(0, -HOP)
        side = sound[1, inner] + divided[0, inner]
        return _Stretch(
            clean=clean,
            marked=front_of(marked[0, inner], side, self._front),
            mark=mark[0, inner],
            end=marked[:, -2 * HOP : -HOP],
            tail=mark[:, -HOP:],
            divided=divided,
            silent=tuple(silent),
            levels=levels,
        )

    def _finished(self) -> int:
        """Return how many samples of the waiting programme have their whole mark."""
        ratio = FS / self._fs
        margin = 0 if ratio == 1.0 else self._mark.reach(ratio)
        return max(0, int((self._mark.end - margin) / ratio) - self._given)

    def _take(self, count: int) -> NDArray[np.float32]:
        count = min(count, self._waiting)
        if not count:
            return np.zeros((0, self._channels), dtype=np.float32)
        ratio = FS / self._fs
        mark = self._mark.read(self._given * ratio, ratio, count)
        across = self._across.read(self._given * ratio, ratio, count)
        taken = self._taken.read(self._given * ratio, ratio, count)
        whole = np.concatenate(self._programme)
        x, self._programme = whole[:count], [whole[count:]]
        self._waiting -= count
        self._host_power += float((mid_of(x) ** 2).sum())
        self._mark_power += float((mark**2).sum())
        self._given += count
        for tape in (self._mark, self._across, self._taken):
            tape.forget(int(self._given * ratio) - 2 * tape.reach(ratio))
        return add_mark(x, mark, across, taken).astype(np.float32)
