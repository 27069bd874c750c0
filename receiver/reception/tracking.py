"""From superframes to the cuer's timeline: places, duplicates, losses, keys and the state.

Superframes come in with their place on air; motion and keys go out with their time on the
programme's clock. The header's sequence number tells a splice from a loss: superframes of one
*epoch* lie on one grid of 0.64 s. The motion of a superframe is due ``lead`` superframes after
it was on air (spec/bitstream.md, section 2).
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

from codec.bitstream.bits import SEQUENCES, Header, read_header
from codec.bitstream.decoder import SuperframeDecoder
from codec.bitstream.payload import is_intact
from codec.bitstream.superframe import DecodedSuperframe, ScoreMerger
from codec.cuer.voice import Voice
from codec.cues.score import Key, Phone
from codec.cues.timeline import TICK_S
from codec.errors import BitstreamError, VoiceError
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

_Timed = TypeVar("_Timed", Phone, Key)

RATE_HZ = 1 / TICK_S
LOST_AFTER_S = 5.5 * SUPERFRAME_S
"""Reception counts as lost this long after the start of the last superframe that arrived."""

_SPLICE_S = 0.1
_RECENT = 4


@dataclass(slots=True)
class _Grid:
    """Places of one epoch: superframe `index` was on air at `on_air_s`, due `delay_s` later."""

    index: int
    on_air_s: float
    delay_s: float

    def index_at(self, on_air_s: float) -> int:
        return self.index + round((on_air_s - self.on_air_s) / SUPERFRAME_S)

    def error_s(self, on_air_s: float) -> float:
        steps = self.index_at(on_air_s) - self.index
        return on_air_s - self.on_air_s - steps * SUPERFRAME_S


class Tracker:
    """Keeps the timeline of one stream.

    Parameters
    ----------
    voice : Voice
        Decodes the parameters.

    Attributes
    ----------
    state : State
        The state of reception.
    received, received_l1, lost : int
        Superframes whose L0 arrived, those with L1 as well, and those that did not arrive.
    """

    def __init__(self, voice: Voice) -> None:
        self._voice = voice
        self._decoder = SuperframeDecoder(voice)
        self._merger = ScoreMerger()
        self.state: State = "searching"
        self.received = self.received_l1 = self.lost = 0
        self._grid: _Grid | None = None
        self._epoch = 0
        self._foreign = False
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
        if l0 is None or not is_intact(l0):
            yield from self._missed(on_air_s)
            return
        try:
            header = read_header(l0)
            if not self._continues(header, on_air_s):
                yield from self._start_epoch(header.sequence, on_air_s, header.lead)
            if self._foreign:
                return
            assert self._grid is not None
            index = self._grid.index_at(on_air_s)
            richness = bool(l1), len(l0) + len(l1 or b"")
            if richness <= self._richness.get(index, (False, 0)):
                return
            decoded = self._decoder.push(l0, l1, index)
        except (VoiceError, BitstreamError) as error:
            self._foreign = True
            yield Unreadable(on_air_s, str(error))
            return
        yield from self._skipped(index)
        self._richness[index] = "L1" in decoded.layers, richness[1]
        self._grid = _Grid(index, on_air_s, header.lead * SUPERFRAME_S)
        self._last_s = max(self._last_s, on_air_s)
        yield from self._deliver(decoded)
        yield from self._judge(on_air_s + SUPERFRAME_S)

    def advance(self, now_s: float) -> Iterator[Event]:
        """Tell that the stream went on to `now_s`: silence is news, too."""
        yield from self._notice_loss(now_s)

    def finish(self) -> Iterator[Event]:
        """Yield what waited for more: the stream has ended."""
        yield from self._settled(self._merger.flush())
        self._merger = ScoreMerger()

    def _continues(self, header: Header, on_air_s: float) -> bool:
        grid = self._grid
        return (
            grid is not None
            and abs(grid.error_s(on_air_s)) < _SPLICE_S
            and (grid.index_at(on_air_s) - header.sequence) % header.sequences == 0
        )

    def _start_epoch(self, sequence: int, on_air_s: float, lead: int) -> Iterator[Event]:
        """Begin a new grid at a splice, or the first one."""
        if self._grid is not None:
            yield from self.finish()
            self._epoch += 1
        self._decoder = SuperframeDecoder(self._voice)
        self._grid = _Grid(sequence, on_air_s, lead * SUPERFRAME_S)
        self._layers.clear()
        self._richness.clear()
        self._recent.clear()
        self._foreign = False

    def _missed(self, on_air_s: float) -> Iterator[Event]:
        if self._grid is None:
            return
        index = self._grid.index_at(on_air_s)
        if index > max(self._layers, default=index):
            yield from self._lose(index)
        yield from self._judge(on_air_s + SUPERFRAME_S)

    def _skipped(self, index: int) -> Iterator[Event]:
        """Tell the losses between the last superframe and this one."""
        for missing in range(max(self._layers, default=index) + 1, index):
            yield from self._lose(missing)

    def _lose(self, index: int) -> Iterator[Event]:
        self._layers[index] = ()
        self.lost += 1
        self._recent.append(False)
        decoded = self._decoder.render(index)
        yield SuperframeLost(decoded.start_s + self._shift_s())
        yield self._piece(decoded)
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
            self._richness.pop(old, None)
        for neighbour in (index - 1, index + 1):
            if neighbour in self._layers:
                yield self._piece(self._decoder.render(neighbour))
        yield self._piece(decoded)
        yield from self._tell_keys(decoded)

    def _tell_keys(self, decoded: DecodedSuperframe) -> Iterator[Event]:
        """Tell what a superframe settles, and what it says itself; a lost one by its previews."""
        yield from self._settled(self._merger.add(decoded))
        if decoded.keys:
            yield KeysFound(self._placed(decoded.keys), final=False)

    def _piece(self, decoded: DecodedSuperframe) -> MotionPiece:
        return MotionPiece(
            decoded.start_s + self._shift_s(), RATE_HZ, decoded.params, decoded.layers,
            self._epoch, self._placed(decoded.phones),
        )  # fmt: skip

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
