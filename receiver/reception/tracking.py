"""From superframes to the cuer's timeline: places, duplicates, losses, keys and the state.

Superframes come in with their place on air; motion and keys go out with their time on the
programme's clock. The header's sequence number distinguishes a splice from a loss: superframes of
one *epoch* lie on one grid of 0.64 s. The motion of a superframe is due ``lead`` superframes after
it was on air (spec/bitstream.md, section 2).
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from codec.cuer.motion import MOST_PARAM
from codec.cuer.voice import Voice
from codec.cues.score import Key, Phone
from codec.cues.timeline import TICK_S
from codec.errors import BitstreamError, VoiceError
from codec.superframe.bits import COMPACT, SEQUENCES, Header, read_header
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.superframe import DecodedSuperframe, ScoreMerger
from receiver.reception.events import (
    SUPERFRAME_S,
    Event,
    KeysFound,
    MotionPiece,
    State,
    StateChanged,
    SuperframeLost,
    Unreadable,
)
from receiver.reception.slew_rate import SlewRateLimiter

_Timed = TypeVar("_Timed", Phone, Key)

RATE_HZ = 1 / TICK_S
"""Frames of parameters per second."""

LOST_AFTER_S = 5.5 * SUPERFRAME_S
"""Reception counts as lost this long after the start of the last superframe that arrived."""

_SPLICE_S = 0.1
"""Least seconds off the grid of a superframe that belongs to another one."""

_RECENT = 4
"""Superframes that decide the state of reception."""

_LATEST, _LONGEST = -8, SEQUENCES
"""Superframes before and after the last one that still count as one epoch: the sequence number
does not distinguish a splice from a loss beyond its period, and the decoder remembers eight."""

_AFTER, _BEFORE = 6, 2
"""Lost superframes of one gap that are drawn: those that previews may hold, and those before the
next that arrived. The hand rests in all between, which are reported as one."""

_PROOF_BITS = 8
"""Bits that agree with one's own identity before a grid is believed that had another
one: another one agrees by chance once in 2**8."""


@dataclass(slots=True)
class _Grid:
    """Places of one epoch: superframe `index` was on air at `on_air_s`, due `delay_s` later."""

    index: int
    on_air_s: float
    delay_s: float

    def index_at(self, on_air_s: float) -> int:
        return self.index + round((on_air_s - self.on_air_s) / SUPERFRAME_S)

    def fits(self, header: Header, on_air_s: float) -> bool:
        """Return whether a superframe lies on this grid, by its place and its number."""
        index = self.index_at(on_air_s)
        error_s = on_air_s - self.on_air_s - (index - self.index) * SUPERFRAME_S
        return (
            abs(error_s) < _SPLICE_S
            and _LATEST <= index - self.index <= _LONGEST
            and (index - header.sequence) % header.sequences == 0
        )


@dataclass(frozen=True, slots=True)
class _Copy:
    """A superframe as it arrived."""

    l0: bytes
    l1: bytes | None
    on_air_s: float
    header: Header


class TimelineTracker:
    """Keeps the timeline of one stream.

    Parameters
    ----------
    voice : Voice
        Decodes the parameters.
    calm : bool
        Whether the hand is held up where it is too fast to be read: for display.
    draw : bool
        Whether to give the motion, and not keys and states alone.

    Attributes
    ----------
    state : State
        The state of reception.
    received, received_l1, lost : int
        Superframes whose L0 arrived, those with L1 as well, and those that did not arrive.
    """

    def __init__(self, voice: Voice, *, calm: bool = False, draw: bool = True) -> None:
        self._voice, self._draws = voice, draw
        self._decoder = self._fresh_decoder()
        self._calm = SlewRateLimiter(voice, RATE_HZ) if calm else None
        self._ends: dict[int, NDArray[np.float32]] = {}
        self._merger = ScoreMerger()
        self.state: State = "searching"
        self.received = self.received_l1 = self.lost = 0
        self._grid: _Grid | None = None
        self._epoch = 0
        self._foreign = ""
        self._doubted: _Grid | None = None
        self._held: list[_Copy] = []
        self._layers: dict[int, tuple[str, ...]] = {}
        self._richness: dict[int, tuple[bool, int]] = {}
        self._recent: deque[bool] = deque(maxlen=_RECENT)
        self._last_s = 0.0

    def take(self, l0: bytes | None, l1: bytes | None, on_air_s: float) -> Iterator[Event]:
        """Take a superframe that was on air from `on_air_s` on; None stands for what failed.

        Yields
        ------
        Event
            The motion of the superframe and, better than before, of the one before it.
        """
        yield from self._notice_loss(on_air_s + SUPERFRAME_S)
        try:
            if l0 is None or not self._decoder.admits(l0):
                yield from self._missed(on_air_s)
                return
            header = read_header(l0)
            for copy in self._believed(_Copy(l0, l1, on_air_s, header)):
                yield from self._draw(copy)
        except (VoiceError, BitstreamError) as error:
            known = read_header(l0) if l0 and isinstance(error, VoiceError) else None
            yield from self._refuse(known, on_air_s, error)

    def _fresh_decoder(self) -> SuperframeDecoder:
        return SuperframeDecoder(self._voice, lips=self._draws, draw=self._draws)

    def _refuse(
        self, header: Header | None, on_air_s: float, error: VoiceError | BitstreamError
    ) -> Iterator[Event]:
        """Draw nothing of foreign superframes, and doubt their grid; one's own stays."""
        self._held.clear()
        if header is not None:
            self._doubted = _Grid(header.sequence, on_air_s, 0.0)
        if self._foreign != str(error):  # more of it has become known
            self._foreign = str(error)
            yield Unreadable(on_air_s, self._foreign)

    def _believed(self, copy: _Copy) -> list[_Copy]:
        """Return what may be drawn: on a grid that is doubted only after some proof.

        A compact superframe that leaves the grid is doubted as well: one in four of another
        voice's agrees by chance.
        """
        header, grid = copy.header, self._grid
        if self._doubted is None or not self._doubted.fits(header, copy.on_air_s):
            self._held.clear()
            goes_on = grid is None or grid.fits(header, copy.on_air_s)
            if goes_on or header.mode != COMPACT:
                return [copy]
        self._doubted = _Grid(header.sequence, copy.on_air_s, 0.0)
        self._held.append(copy)
        places = {self._doubted.index_at(held.on_air_s) for held in self._held}
        if len(places) * (2 if header.mode == COMPACT else 16) < _PROOF_BITS:
            return []
        believed, self._held = self._held, []
        return believed

    def _draw(self, copy: _Copy) -> Iterator[Event]:
        grid = self._grid
        goes_on = grid is not None and grid.fits(copy.header, copy.on_air_s)
        index = copy.header.sequence
        if grid is not None and goes_on:
            index = grid.index_at(copy.on_air_s)
        # Copies of one superframe by several carriers: only a richer one is drawn again.
        richness = bool(copy.l1), len(copy.l0) + len(copy.l1 or b"")
        if goes_on and richness <= self._richness.get(index, (False, 0)):
            return
        decoder = self._decoder if goes_on else self._fresh_decoder()
        decoded = decoder.push(copy.l0, copy.l1, index)
        lead_s = copy.header.lead * SUPERFRAME_S
        if not goes_on:
            yield from self._start_epoch(decoder, _Grid(index, copy.on_air_s, lead_s))
        self._foreign, self._doubted = "", None
        yield from self._skipped(index)
        self._richness[index] = "L1" in decoded.layers, richness[1]
        self._grid = _Grid(index, copy.on_air_s, lead_s)
        self._last_s = max(self._last_s, copy.on_air_s)
        yield from self._deliver(decoded)
        yield from self._judge(copy.on_air_s + SUPERFRAME_S)

    def advance(self, now_s: float) -> Iterator[Event]:
        """Tell that the stream went on to `now_s`: silence is news, too."""
        yield from self._notice_loss(now_s)

    def finish(self) -> Iterator[Event]:
        """Yield what waited for more: the stream has ended."""
        yield from self._settled(self._merger.flush())
        self._merger = ScoreMerger()

    def _start_epoch(self, decoder: SuperframeDecoder, grid: _Grid) -> Iterator[Event]:
        """Begin a new grid at a splice, or the first one."""
        if self._grid is not None:
            yield from self.finish()
            self._epoch += 1
        self._decoder, self._grid = decoder, grid
        self._layers.clear()
        self._ends.clear()
        self._richness.clear()
        self._recent.clear()

    def _missed(self, on_air_s: float) -> Iterator[Event]:
        if self._grid is None:
            return
        index = self._grid.index_at(on_air_s)
        if index - self._grid.index <= _LONGEST:
            yield from self._skipped(index + 1)
        yield from self._judge(on_air_s + SUPERFRAME_S)

    def _skipped(self, end: int) -> Iterator[Event]:
        """Tell the losses between the last superframe that is known of and `end`."""
        lost = range(max(self._layers, default=end) + 1, end)
        drawn = len(lost) if len(lost) <= _AFTER + _BEFORE else _AFTER
        for index in lost[:drawn]:
            yield from self._lose(index)
        rest = lost[drawn:-_BEFORE]
        if rest:
            self._layers |= dict.fromkeys(rest, ())
            self.lost += len(rest)
            yield SuperframeLost(rest[0] * SUPERFRAME_S + self._shift_s(), len(rest))
            for index in lost[-_BEFORE:]:
                yield from self._lose(index)

    def _lose(self, index: int) -> Iterator[Event]:
        self._layers[index] = ()
        self.lost += 1
        self._recent.append(False)
        decoded = self._decoder.render(index)
        yield SuperframeLost(decoded.start_s + self._shift_s())
        yield from self._pieces(decoded)
        yield from self._tell_keys(decoded)

    def _deliver(self, decoded: DecodedSuperframe) -> Iterator[Event]:
        index = decoded.index
        known = self._layers.get(index)
        if not known:
            self.received += 1
            self.lost -= known is not None
            self._recent.append(True)
        self.received_l1 += "L1" in decoded.layers and "L1" not in (known or ())
        self._layers[index] = decoded.layers
        for old in [i for i in self._layers if i < index - SEQUENCES]:
            del self._layers[old]
            self._ends.pop(old, None)
            self._richness.pop(old, None)
        for neighbour in (index - 1, index + 1):
            if neighbour in self._layers and self._draws:
                yield from self._pieces(self._decoder.render(neighbour))
        yield from self._pieces(decoded)
        yield from self._tell_keys(decoded)

    def _tell_keys(self, decoded: DecodedSuperframe) -> Iterator[Event]:
        """Emit the events that a superframe settles, and its own; a lost one by its previews."""
        yield from self._settled(self._merger.add(decoded))
        if decoded.keys:
            yield KeysFound(self._placed(decoded.keys), final=False)

    def _pieces(self, decoded: DecodedSuperframe) -> Iterator[MotionPiece]:
        """Yield the motion of a superframe if it is wanted."""
        if not self._draws:
            return
        params = np.clip(decoded.params, -MOST_PARAM, MOST_PARAM)
        if self._calm is not None:
            params = self._calm.calmed(params, self._ends.get(decoded.index - 1))
            self._ends[decoded.index] = params[-1]
        yield MotionPiece(
            decoded.start_s + self._shift_s(),
            RATE_HZ,
            params,
            decoded.layers,
            self._epoch,
            self._placed(decoded.phones),
        )

    def _settled(self, keys: list[Key]) -> Iterator[Event]:
        if keys:
            yield KeysFound(self._placed(keys), final=True)

    def _shift_s(self) -> float:
        """Programme time of the motion of superframe 0 of this epoch."""
        assert self._grid is not None
        return self._grid.on_air_s + self._grid.delay_s - self._grid.index * SUPERFRAME_S

    def _placed(self, line: Iterable[_Timed]) -> tuple[_Timed, ...]:
        shift_s = self._shift_s()
        return tuple(replace(x, start=x.start + shift_s, end=x.end + shift_s) for x in line)

    def _notice_loss(self, now_s: float) -> Iterator[Event]:
        lost_s = self._last_s + LOST_AFTER_S
        if self.state in ("locked", "degraded") and now_s >= lost_s:
            self.state = "lost"
            yield StateChanged(lost_s, "lost")

    def _judge(self, now_s: float) -> Iterator[Event]:
        """Change between locked and degraded by the last few superframes."""
        found = bool(self._recent) and self._recent[-1]
        if not found and self.state in ("searching", "lost"):
            return
        state: State = "locked" if all(self._recent) else "degraded"
        if state != self.state:
            self.state = state
            yield StateChanged(now_s, state)
