"""Writing of windows: how a line of phones is spread over compact superframes.

Each window codes as much as its bytes hold, as well-timed as its successors can keep up with.
Specification: spec/bitstream.md, section 3.1.
"""

import bisect
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from codec.cues.cueing import CueingOptions
from codec.cues.language import Language
from codec.cues.timeline import TICKS, ScoreLine
from codec.superframe import _steering
from codec.superframe.bits import (
    COMPACT,
    COMPACT_HEADER_BYTES,
    COMPACT_LEAD,
    COMPACT_SEQUENCES,
    PROOF_BITS,
    Header,
    identity_bits,
)
from codec.superframe.range_coder import TOTAL, RangeEncoder, encode_intervals
from codec.superframe.score_coding import write_options
from codec.superframe.slow_channel import SILENT, SlowSender
from codec.superframe.tables import score_tables
from codec.superframe.window import (
    BEGIN,
    BEGIN_CELL,
    BEGIN_UNIT,
    CORRECTION,
    CORRECTIONS,
    EARLIEST,
    FINE,
    LAST,
    PACE,
    PACES,
    PIECE_BITS,
    PLAIN_OR_SPECIAL,
    RULED,
    SLOW,
    TIMING,
    UNIT,
    Window,
    begin_bits,
    length_row,
    read_window,
    ruled,
)

_CORRECTION_TICKS = np.array(CORRECTIONS)
_CORRECTION_BITS = np.log2(TOTAL) - np.log2(np.diff(CORRECTION))
_PACE_BITS = np.log2(TOTAL) - np.log2(np.diff(PACE))

_FINE_REACHES = 20
"""Tick of the next superframe up to which a window with lengths to a tick has to reach."""

_WEIGHTS = ((3.0, 1.5), (0.6, 1.5), (0.12, 1.5), (0.03, 1.5), (0.01, 1.5), (0.004, 0.3))
"""Bits that a squared tick of error is worth, and a tick of more than four where a key starts: from
well-timed to hardly timed windows."""

_INSIDE = 0.3
"""Weight of errors where no key starts, against those where one does."""

_AHEAD = 40
"""Phones over which corrections are chosen."""

_BEYOND = 40
"""Bits beyond its room up to which a code is written, before it is cut off."""

_HORIZON = 16
"""Windows over which a writer looks ahead."""

_PAUSE_BITS = 3.0
"""Bits that a pause takes, about."""

_VOWEL_BITS = 1.0
"""Bits of a pause's length and of a vowel's correction, about."""

_OPENING_PAUSE_BITS = 5.0
"""Bits of a pause that begins a window, about."""

_RULED_BITS = 14.0
"""Bits of a window with rule-based timing that are not phones, about."""


_LATE = 4
"""Maximum end-time error of the last phone, in ticks."""

_LONGER = 8
"""Most ticks that a phone may last longer than coded without ending its window."""

_Meant = tuple[int, int, int, int]
"""Number, start and end of a phone in a window, and symbols of the code up to its end."""


@dataclass(frozen=True, slots=True)
class _Timing:
    """How a window codes lengths: timing, pace and corrections of the next phones."""

    timing: int
    pace: int = 0
    corrections: tuple[int, ...] = ()

    def correction(self, k: int) -> int:
        """Return the symbol of the correction of phone number `k` of the window."""
        return self.corrections[k] if k < len(self.corrections) else 0


class WindowWriter:
    """Compact superframes of a line of phones, each of the same size.

    Parameters
    ----------
    line : ScoreLine
    options : CueingOptions
        Under which the receiver derives keys.
    identity : str
        Of the voice.
    size : int
        Bytes of L0.
    first : int
        Number of the first superframe that will be on air.
    signed : bool
        Leave room for a proof.
    slow : SlowSender
        Tells lasting facts.
    """

    def __init__(
        self,
        line: ScoreLine,
        options: CueingOptions,
        identity: str,
        size: int,
        *,
        first: int = 0,
        signed: bool = False,
        slow: SlowSender = SILENT,
    ) -> None:
        self._line = line
        self._options, self._language = options, options.language
        self._tables = score_tables(options.language)
        self._identity = identity
        self._room = size - COMPACT_HEADER_BYTES
        self._header = Header(COMPACT, 0, COMPACT_LEAD, signed)
        self._slow = slow
        spoken = (line.starts[1] - LAST) // TICKS + 1 if len(line.starts) > 1 else 0
        self._first = max(first, spoken)
        self._payloads: list[bytes] = []
        self._next = 1
        self._spent, self._silence = _spent(line, options.language), _silences(line)
        self._numbers = np.array(line.numbers, dtype=np.int64)
        ends = (*line.starts[1:], line.starts[-1])
        self._lengths = np.array(ends, dtype=np.int64) - np.array(line.starts, dtype=np.int64)
        starts_key = [self._starts_key(k) for k in range(1, len(line.numbers))]
        self._ends = np.array([1.0 if key else _INSIDE for key in [*starts_key, False]])

    def l0(self, index: int) -> bytes:
        """Return the L0 part of superframe `index`."""
        while index >= self._first + len(self._payloads) and self._next < len(self._line.starts):
            self._payloads.append(self._payload(self._first + len(self._payloads)))
        place = index - self._first
        inside = 0 <= place < len(self._payloads)
        payload = self._payloads[place] if inside else self._empty(index)
        header = replace(self._header, sequence=index % COMPACT_SEQUENCES)
        proof = PROOF_BITS[COMPACT] if header.signed else 0
        number = int.from_bytes(payload, "big") | identity_bits(self._identity, index) << proof
        return header.to_bytes() + number.to_bytes(self._room, "big")

    def _payload(self, index: int) -> bytes:
        """Return the next payload, and go on behind the phones that it holds."""
        line, begin = self._line, index * TICKS
        while self._next < len(line.starts) and not line.numbers[self._next]:
            self._next += 1
        if self._next < len(line.starts) and line.starts[self._next] < begin + EARLIEST:
            # Speech that no timing keeps up with loses keys; it goes on with a consonant, as a
            # vowel could be taken for that of the last one coded.
            while self._next < len(line.starts) and (
                line.starts[self._next] < begin + EARLIEST
                or not self._language.is_consonant(line.numbers[self._next])
            ):
                self._next += 1
        if self._next == len(line.starts) or line.starts[self._next] > begin + LAST:
            return self._empty(index)
        start = self._next - self._needs_pause(self._next)
        best = start, self._empty(index), _Timing(FINE)
        for timing in self._timings(index, start):
            payload = self._code(index, start, timing)
            window = self._window_of(payload)
            reached = start + len(window.numbers)
            best = max(best, (reached, payload, timing), key=lambda told: told[0])
            if self._suffices(index + 1, reached, timing):
                best = reached, payload, timing
                break
        self._next, payload, timing = best
        if self._loses_vowel(index + 1, self._next):
            self._next, payload = self._without_half(index, start, self._next - 1, timing)
        return payload

    def _loses_vowel(self, index: int, k: int) -> bool:
        """Return whether `index` comes too late for a vowel `k` whose consonant was sent before."""
        line = self._line
        if (
            k == len(line.starts)
            or not self._language.is_vowel(line.numbers[k])
            or self._starts_key(k)
        ):
            return False
        return line.starts[k] < index * TICKS + EARLIEST

    def _without_half(
        self, index: int, start: int, end: int, timing: "_Timing"
    ) -> tuple[int, bytes]:
        """Return the longest payload that ends with a pause, before phone `end` at most.

        A consonant whose vowel is lost would be another key.
        """
        for k in range(end, start, -1):
            payload = self._code(index, start, timing, end=k)
            if len(self._window_of(payload).numbers) == k - start:
                return k, payload
        return start, self._empty(index)

    def _suffices(self, index: int, k: int, timing: "_Timing") -> bool:
        """Return whether a window that ends before phone `k` leaves `index` on enough time."""
        line = self._line
        if timing.timing == FINE:
            rest = next((i for i in range(k, len(line.starts)) if line.numbers[i]), None)
            if rest is not None and line.starts[rest] < index * TICKS + _FINE_REACHES:
                return False
        return self._keeps_up(index, k)

    def _keeps_up(self, index: int, k: int) -> bool:
        """Return whether windows from `index` on keep up with speech from phone `k` on.

        It is tried with predicted timing, which takes least, over a few windows to come.
        """
        starts, numbers = self._line.starts, self._line.numbers
        for tick in range(index * TICKS, (index + _HORIZON) * TICKS, TICKS):
            while k < len(starts) and not numbers[k]:
                k += 1
            if k == len(starts) or starts[k] > tick + LAST:
                continue
            if starts[k] < tick + EARLIEST:
                return False
            full = self._spent[k] + 8 * self._room - self._header.tail - _RULED_BITS
            full -= _OPENING_PAUSE_BITS if self._needs_pause(k) else 0.0
            k = min(
                max(bisect.bisect_right(self._spent, full) - 1, k + 1),
                bisect.bisect_right(starts, tick + LAST),
                self._silence[k],
            )
        return True

    def _needs_pause(self, k: int) -> bool:
        """Return whether a window that begins with a phone has to code the pause before it.

        It could be taken for the vowel of a consonant in the window before, or in a lost one.
        """
        numbers = self._line.numbers
        return (
            self._language.is_vowel(numbers[k])
            and numbers[k - 1] == 0
            and (not self._payloads or self._language.is_consonant(numbers[k - 2]))
        )

    def _starts_key(self, k: int) -> bool:
        numbers = self._line.numbers
        return self._language.starts_key(numbers[k - 1], numbers[k])

    def _timings(self, index: int, first: int) -> Iterator["_Timing"]:
        """Yield ways to code the lengths of phones from `first` on, the best one first."""
        yield _Timing(FINE)
        for weight, limit in _WEIGHTS:
            yield self._steered(index, first, weight, limit)

    def _steered(self, index: int, first: int, weight: float, limit: float) -> "_Timing":
        """Return pace and corrections that weigh errors of time against bits."""
        line = self._line
        ahead = slice(first, min(first + _AHEAD, len(line.starts) - 1))
        numbers, true = self._numbers[ahead], self._lengths[ahead]
        kinds = np.where(numbers == 0, 0, np.where(numbers <= self._language.n_vowels, 2, 1))
        weights = weight * self._ends[ahead]
        limits = limit * (self._ends[ahead] == 1.0)
        begin = self._begin(index, first, RULED) + index * TICKS
        error = begin - line.starts[first] if line.numbers[first] else 0
        usual = self._tables.usual[numbers]
        best = float("inf"), _Timing(RULED)
        for pace, factor in enumerate(PACES):
            chosen = np.zeros(len(numbers), dtype=np.int64)
            cost = _PACE_BITS[pace] + _steering.steer(
                usual * factor + 64 >> 7, true, kinds, weights, limits, error,
                _CORRECTION_TICKS, _CORRECTION_BITS, chosen,
            )  # fmt: skip
            if cost < best[0]:
                best = cost, _Timing(RULED, pace, tuple(chosen.tolist()))
        return best[1]

    def _empty(self, index: int) -> bytes:
        """Return the payload of a superframe where nothing begins."""
        encoder = self._opened(index, 0, _Timing(FINE))
        pause, none = self._language.letter_of(0), self._language.n_phones
        encoder.put(pause, self._tables.opening)
        encoder.put(pause, self._tables.next[none, 0])
        row, limit = length_row(0, 0, FINE, self._tables)
        encoder.put(limit, row, limit)
        return self._fitted(encoder.finish(certain=True))

    def _fitted(self, code: bytes) -> bytes:
        """Return a code cut off or filled up to its room, zeros where it must not reach."""
        payload = code[: self._room].ljust(self._room, b"\0")
        tail = self._header.tail
        return (int.from_bytes(payload, "big") >> tail << tail).to_bytes(self._room, "big")

    def _window_of(self, payload: bytes) -> Window:
        return read_window(self._header.to_bytes() + payload, language=self._language)

    def _opened(self, index: int, begin: int, timing: "_Timing") -> RangeEncoder:
        encoder = RangeEncoder()
        encoder.put(int(self._slow.due(index)), SLOW)
        if self._slow.due(index):
            encoder.put_bits(self._slow.piece(index), PIECE_BITS)
        special = not self._options.are_usual
        encoder.put(int(special), PLAIN_OR_SPECIAL)
        if special:
            write_options(encoder, self._options)
        cell, rest = divmod(begin - EARLIEST, BEGIN_CELL)
        encoder.put(timing.timing, TIMING)
        encoder.put(cell, BEGIN)
        encoder.put_bits(rest // BEGIN_UNIT[timing.timing], begin_bits(timing.timing))
        if timing.timing == RULED:
            encoder.put(timing.pace, PACE)
        return encoder

    def _begin(self, index: int, first: int, timing: int) -> int:
        """Return the first tick of a window that begins with phone `first`."""
        line, unit = self._line, BEGIN_UNIT[timing]
        tick = line.starts[first] - index * TICKS
        if line.numbers[first] == 0:
            tick = line.starts[first + 1] - index * TICKS - unit
        tick = min(max(tick + unit // 4, EARLIEST), LAST) - EARLIEST
        return tick + EARLIEST - tick % unit

    def _code(self, index: int, first: int, timing: "_Timing", *, end: int | None = None) -> bytes:
        """Return the code of the phones from number `first` on, cut off at its room.

        Before phone `end` it says that a pause follows.
        """
        line, tables, letter_of = self._line, self._tables, self._language.letter_of
        none = self._language.n_phones
        tick = self._begin(index, first, timing.timing)
        encoder = self._opened(index, tick, timing)
        context, spoken, meant = (none, none), 0, list[_Meant]()
        for k in range(first, len(line.starts)):
            number = line.numbers[k]
            encoder.put(letter_of(number), tables.opening if k == first else tables.next[context])
            if number and timing.timing == RULED:
                correction = timing.correction(k - first)
                if self._language.is_vowel(number):
                    encoder.put(correction, CORRECTION)
                ticks = ruled(number, tables, timing.pace, correction)
            elif k == first and number == 0:
                ticks = BEGIN_UNIT[timing.timing]
            else:
                row, limit = length_row(number, spoken, timing.timing, tables)
                unit, units = UNIT[timing.timing], limit + 1
                if k + 1 < len(line.starts):
                    until = line.starts[k + 1] - index * TICKS
                    units = min(max((until - tick + unit // 2) // unit, 1), limit + 1)
                encoder.put(units - 1, row, limit)
                if number == 0 and units > limit:
                    break
                ticks = unit * units
            context, spoken = (context[1], number), ticks if number else 0
            tick += ticks
            meant.append((number, tick - ticks, tick, len(encoder)))
            last = k + 1 == end or self._outlasts(index, k + 1, tick)
            if number and last:
                # The next window begins where it really ends.
                encoder.put(letter_of(0), tables.next[context])
                row, limit = length_row(0, spoken, timing.timing, tables)
                encoder.put(limit, row, limit)
                break
            if tick > LAST or encoder.bits > 8 * self._room + _BEYOND:
                break
        return self._cut(encoder, meant)

    def _outlasts(self, index: int, k: int, tick: int) -> bool:
        """Return whether the phone before `k` lasts longer than a window can code."""
        starts = self._line.starts
        return k < len(starts) and starts[k] - index * TICKS - tick > _LONGER

    def _cut(self, encoder: RangeEncoder, meant: Sequence[_Meant]) -> bytes:
        """Return a code cut to its room such that it holds as many phones as possible.

        `meant` are number, start and end of each phone, and where its code ends. A code that is
        cut off holds no phone but those; one that ends after as many of them as barely fit may
        hold one more, if the bits behind it by chance code none.
        """
        starts, freqs = encoder.intervals()
        best = self._fitted(encode_intervals(starts, freqs, certain=True))
        told = len(self._window_of(best).numbers)
        for _, _, _, end in meant[told : told + 2]:
            payload = encode_intervals(starts[:end], freqs[:end], certain=True)
            if len(payload) > self._room:
                break
            payload = self._fitted(payload)
            window = self._window_of(payload)
            if len(window.numbers) > told and _agrees(window, meant):
                best, told = payload, len(window.numbers)
        return best


def _agrees(window: Window, meant: Sequence[_Meant]) -> bool:
    """Return whether a window decodes to the intended phones and nothing else."""
    n = len(window.numbers)
    return (
        n <= len(meant)
        and window.numbers == tuple(number for number, _, _, _ in meant[:n])
        and window.starts == tuple(start for _, start, _, _ in meant[:n])
        and abs(window.end - meant[n - 1][2]) <= _LATE
    )


def _spent(line: ScoreLine, language: Language) -> list[float]:
    """Return the bits of all phones before each one, with predicted times, and of all at last."""
    tables, none = score_tables(language), language.n_phones
    bits, context = [0.0], (none, none)
    for number in line.numbers:
        row, letter = tables.next[context[0], context[1] % none], language.letter_of(number)
        bits.append(bits[-1] - math.log2((row[letter + 1] - row[letter]) / TOTAL))
        if not number:
            bits[-1] += _PAUSE_BITS
        elif language.is_vowel(number):
            bits[-1] += _VOWEL_BITS
        context = context[1], number
    return bits


def _silences(line: ScoreLine) -> list[int]:
    """Return the number of the next pause that ends a window, for each phone."""
    after, found = len(line.starts), list[int]()
    for k in range(len(line.starts) - 1, -1, -1):
        end = line.starts[k + 1] if k + 1 < len(line.starts) else line.starts[k] + TICKS
        if not line.numbers[k] and end - line.starts[k] >= TICKS:
            after = k
        found.append(after)
    return found[::-1]
