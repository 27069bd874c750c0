"""Plain samples on their way: held for a while, and exchanged for marked ones where there are any.

The same contract as `cuecast.live.multiplex.Multiplex`, for a line of PCM without a container.
"""

import re
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError
from cuecast.live.multiplex import READ_ON_S, TIES, Send
from cuecast.media.encode import as_samples
from watermark.audio.signal.mix import check_format

_TYPES = {"s16le": ("<i2", "s16", 16), "s32le": ("<i4", "s32", 32), "f32le": ("<f4", "flt", 32)}


@dataclass(frozen=True, slots=True)
class PcmForm:
    """How samples lie on a line: their type, rate in Hz, and channels.

    Examples
    --------
    >>> PcmForm.read("s16le:48000:2").frame_bytes
    4
    """

    kind: str
    fs: int
    channels: int

    @classmethod
    def read(cls, text: str) -> "PcmForm":
        """Read ``s16le:48000:2``.

        Raises
        ------
        CueError
            If there is no such form, or it cannot be marked.
        """
        match = re.fullmatch(r"(\w+):(\d{4,6}):(\d)", text)
        if match is None or match[1] not in _TYPES:
            raise CueError(f"samples {text!r}: say it as s16le:48000:2, of {', '.join(_TYPES)}")
        check_format(int(match[2]), int(match[3]))
        return cls(match[1], int(match[2]), int(match[3]))

    @property
    def frame_bytes(self) -> int:
        """Bytes of one sample of all channels."""
        return np.dtype(_TYPES[self.kind][0]).itemsize * self.channels

    def floats(self, data: bytes) -> NDArray[np.float32]:
        """Return samples, shape (n, channels), full scale 1."""
        dtype, _, bits = _TYPES[self.kind]
        x = np.frombuffer(data, dtype).reshape(-1, self.channels)
        scale = 1.0 if x.dtype.kind == "f" else 1.0 / (1 << (bits - 1))
        return (x * scale).astype(np.float32)

    def bytes(self, samples: NDArray[np.float32]) -> "bytes":
        """Return samples as they lie on the line."""
        dtype, form, bits = _TYPES[self.kind]
        return as_samples(samples, form, bits).astype(dtype).tobytes()


@dataclass(frozen=True, slots=True)
class MarkedPcm:
    """Marked samples, and the number of the first one on the line."""

    first: int
    data: bytes


@dataclass(frozen=True, slots=True)
class _HeldPcm:
    due_s: float
    first: int
    data: bytes


class PcmPassage:
    """The line between its arrival and its departure; see `Multiplex` for the arguments.

    Attributes
    ----------
    figures : dict of str to float
    marks : int
        Pieces of marked samples that came in.
    dropped : int
        0: a line of samples has no garbage.
    """

    def __init__(
        self,
        form: PcmForm,
        delay_s: float,
        send: Send,
        *,
        tell: Callable[[str], None] = lambda line: None,
        wait: Callable[[], bool] = lambda: False,
        by_stream: bool = False,
    ) -> None:
        self._form, self._delay_s, self._send = form, delay_s, send
        self._tell, self._wait, self._by_stream = tell, wait, by_stream
        self._part = b""
        self._count = self.marks = self.dropped = 0
        self._due_s = 0.0
        self._held: deque[_HeldPcm] = deque()
        self._marked: deque[MarkedPcm] = deque()
        self.marking, self.audible = False, True
        self.figures = dict.fromkeys(
            ("packets_total", "packets_lost_total", "marked_seconds_total",
             "bypass_seconds_total", "bypasses_total", "stale_packets_total"), 0.0
        )  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in TIES}

    def tie(self, **ties: Any) -> None:
        """Set the functions that a pickled one comes without, see `Multiplex.tie`."""
        vars(self).update({f"_{name}": one for name, one in ties.items()})

    @property
    def held_s(self) -> float:
        """When the oldest samples are due."""
        return self._held[0].due_s if self._held else float("inf")

    @property
    def can_wait(self) -> bool:
        """Whether the samples on their way out can wait for further ones."""
        return self._count / self._form.fs - self._due_s <= READ_ON_S

    @property
    def held_bytes(self) -> int:
        """How much waits."""
        return sum(len(one.data) for one in self._held)

    def take(self, data: bytes, now_s: float) -> None:
        """Take bytes that arrived at `now_s`."""
        data = self._part + data
        size = len(data) // self._form.frame_bytes * self._form.frame_bytes
        data, self._part = data[:size], data[size:]
        if not data:
            return
        clock_s = self._count / self._form.fs if self._by_stream else now_s
        self._held.append(_HeldPcm(clock_s + self._delay_s, self._count, data))
        self._send("pcm", self._form, self._count, data)
        self._count += size // self._form.frame_bytes

    def put(self, epoch: int, marked: Any) -> None:
        """Take marked samples."""
        del epoch
        self.marks += 1
        self._marked.append(marked)

    def end(self) -> None:
        """Nothing is under way here."""

    def give(self, now_s: float) -> Iterator[bytes]:
        """Yield the samples due."""
        while self._held and self._held[0].due_s <= (
            self._count / self._form.fs if self._by_stream else now_s
        ):
            yield self._made(self._held.popleft())

    def rest(self) -> Iterator[bytes]:
        """Yield all that is held."""
        while self._held:
            yield self._made(self._held.popleft())

    def _made(self, held: _HeldPcm) -> bytes:
        self._due_s = held.due_s
        found = self._found(held)
        while found is None and self._wait():
            found = self._found(held)
        seconds = len(held.data) / self._form.frame_bytes / self._form.fs
        name = "bypass_seconds_total" if found is None else "marked_seconds_total"
        self.figures[name] += seconds
        if (found is not None) != self.marking:
            self.marking = found is not None
            self.figures["bypasses_total"] += not self.marking
        return held.data if found is None else found

    def _found(self, held: _HeldPcm) -> bytes | None:
        """Return the marked samples in place of these, None where some are missing."""
        size = self._form.frame_bytes
        first, last = held.first, held.first + len(held.data) // size
        marked = self._marked
        while marked and marked[0].first + len(marked[0].data) // size <= first:
            marked.popleft()
        out, at = b"", first
        for one in marked:
            if one.first > at:
                return None
            out += one.data[(at - one.first) * size : (last - one.first) * size]
            at = first + len(out) // size
            if at >= last:
                return out
        return None
