"""What became of each superframe of a programme that a playout sent.

Packets in, as they were meant for the playout, as they reached it and as they left it; out: the
places of superframes with their fates, and the stretches that left unmarked. A PES packet that left
as it came is unmarked; the playout's own figures are not used.
"""

import itertools
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import av

from codec.errors import CueError
from codec.superframe.bits import read_header
from cuecast.live.frames import FrameCutter
from cuecast.live.multiplex import chosen_sound
from cuecast.live.packets import TICKS_HZ, Pes, PesReader, pid_of, step
from cuecast.live.sound_run import CODERS
from cuecast.media.tables import TableReader
from receiver.media.sound import as_float
from watermark.audio.receiver import AudioReceiver
from watermark.link.superframe import SUPERFRAME_S

_SAME_GRID_S = 0.05
"""Starts of one grid are multiples of 0.64 s apart but for this."""

_GAP_S = 0.05
"""Pieces of sound that are closer follow each other; coders shift theirs by less."""

Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Piece:
    """A PES packet of the sound: its time in the programme, its coding and its data."""

    start_s: float
    end_s: float
    kind: str
    frames: tuple[bytes, ...]
    data: bytes


@dataclass(frozen=True, slots=True)
class Arrived:
    """A received superframe: its start in the programme, and its number modulo 64 or 16."""

    start_s: float
    number: int
    numbers: int


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened while the sound of a span of the programme was on its way."""

    name: str
    span: Span


@dataclass(frozen=True, slots=True)
class Account:
    """What became of the superframes.

    Attributes
    ----------
    received : int
    misnumbered : int
        Those whose number is not that of their place after the one before.
    lost : dict of str to int
        Those that did not arrive, by cause.
    unmarked_s : dict of str to float
        Seconds that left unmarked or not at all, by cause.
    unexplained_s : tuple of float
        Where superframes were lost without a cause.
    """

    received: int
    misnumbered: int
    lost: dict[str, int]
    unmarked_s: dict[str, float]
    unexplained_s: tuple[float, ...]


def pieces(packets: Iterable[bytes], zero: int | None = None) -> tuple[list[Piece], int]:
    """Return the PES packets of the first sound, and the time stamp from which they count."""
    tables, reader = TableReader(None), PesReader()
    pid, kind, found = -1, "", list[Piece]()

    def note(all_pes: Iterable[Pes]) -> None:
        nonlocal zero
        for pes in all_pes:
            if pes.pts is None:
                continue
            zero = pes.pts if zero is None else zero
            frames = [f for part in pes.parts for f, _ in FrameCutter(kind).process(part)]
            start_s = step(pes.pts, zero) / TICKS_HZ
            end_s = start_s + sum(f.length_s for f in frames)
            found.append(
                Piece(start_s, end_s, kind, tuple(f.data for f in frames), b"".join(pes.parts))
            )

    for packet in packets:
        if pid_of(packet) in tables.pids and tables.process(packet) and tables.programme:
            note(reader.flush())
            sound = chosen_sound(tables.programme, 0)
            pid, kind = (sound.pid, sound.kind) if sound else (-1, "")
        elif pid_of(packet) == pid:
            note(reader.process(packet))
    note(reader.flush())
    if zero is None:
        raise CueError("no sound came")
    return found, zero


def joined(spans: Iterable[Span]) -> list[Span]:
    """Return spans in order, those that follow each other as one."""
    out: list[Span] = []
    for begin, end in sorted(spans):
        if out and begin <= out[-1][1] + _GAP_S:
            out[-1] = out[-1][0], max(end, out[-1][1])
        else:
            out.append((begin, end))
    return out


def between(spans: list[Span], whole: Span) -> list[Span]:
    """Return the parts of a span that lie between some others."""
    edges = [whole[0], *(edge for span in spans for edge in span), whole[1]]
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > _GAP_S]


def receive(output: list[Piece], key: int = 0) -> list[Arrived]:
    """Return the superframes of the sound that left."""
    found: list[Arrived] = []
    for _, run in itertools.groupby(output, key=_Runs()):
        found += _receive_run(list(run), key)
    return sorted(found, key=lambda one: one.start_s)


class _Runs:
    """Numbers the stretches of sound of one coding without a gap."""

    def __init__(self) -> None:
        self._last: Piece | None = None
        self._number = 0

    def __call__(self, piece: Piece) -> int:
        last = self._last
        if last and (last.kind != piece.kind or abs(piece.start_s - last.end_s) > _GAP_S):
            self._number += 1
        self._last = piece
        return self._number


def _receive_run(run: list[Piece], key: int) -> list[Arrived]:
    decoder: Any = av.CodecContext.create(CODERS[run[0].kind][0], "r")
    receiver: AudioReceiver | None = None
    found: list[Arrived] = []
    for frame in (f for piece in run for f in piece.frames):
        try:
            sounds = decoder.decode(av.Packet(frame))
        except (av.FFmpegError, ValueError):
            continue
        for sound in sounds:
            if receiver is None:
                channels = sound.layout.nb_channels
                receiver = AudioReceiver(sound.sample_rate, channels, key=key, guess=False)
            found += _arrived(receiver.process(as_float(sound)), run[0].start_s)
    return found + (_arrived(receiver.flush(), run[0].start_s) if receiver else [])


def _arrived(superframes: Iterable[Any], begins_s: float) -> list[Arrived]:
    out = []
    for one in superframes:
        if one.l0 is not None:
            header = read_header(one.l0)
            out.append(Arrived(begins_s + one.position_s, header.sequence, header.sequences))
    return out


def account(
    meant: Iterable[bytes], reached: Iterable[bytes], left: Iterable[bytes], events: list[Event]
) -> Account:
    """Return what became of the superframes of a programme.

    Parameters
    ----------
    meant, reached, left : iterable of bytes
        Packets as they were sent to the playout, those of them that came there, and its output.
    events : list of Event
        What explains that sound leaves unmarked or that superframes are lost.
    """
    programme, zero = pieces(meant)
    came = {(one.start_s, one.data) for one in pieces(reached, zero)[0]}
    output, _ = pieces(left, zero)
    whole = programme[0].start_s, programme[-1].end_s
    holes = joined((p.start_s, p.end_s) for p in programme if (p.start_s, p.data) not in came)
    marked = joined((p.start_s, p.end_s) for p in output if (p.start_s, p.data) not in came)
    unmarked = between(marked, whole)
    named = [(_cause(span, events) or "busy", span) for span in unmarked]
    arrived = receive(output)
    lost: Counter[str] = Counter()
    unexplained: list[float] = []
    for start_s in missing([one.start_s for one in arrived], whole):
        place = start_s, start_s + SUPERFRAME_S
        cause = "lost datagram" if any(_meet(place, hole) for hole in holes) else ""
        cause = cause or next((f"unmarked: {n}" for n, s in named if _meet(place, s)), "")
        cause = cause or _cause(place, events) or "unexplained"
        lost[cause] += 1
        if cause == "unexplained":
            unexplained.append(round(start_s, 3))
    seconds: Counter[str] = Counter()
    for name, (begin, end) in named:
        seconds[name] += round(end - begin, 3)  # type: ignore[assignment]
    return Account(
        len(arrived), misnumbered(arrived), dict(lost), dict(seconds), tuple(unexplained)
    )


def _meet(one: Span, other: Span) -> bool:
    return one[0] < other[1] and other[0] < one[1]


def _cause(span: Span, events: list[Event]) -> str:
    return next((event.name for event in events if _meet(span, event.span)), "")


def missing(starts: list[float], whole: Span) -> list[float]:
    """Return the starts of places without a superframe: before, between and after those received.

    Where one grid of places ends and another begins, only whole places between them count.

    Examples
    --------
    >>> missing([0.64, 2.56], (0.0, 4.0))
    [0.0, 1.28, 1.92, 3.2]
    """
    step_s = SUPERFRAME_S
    if not starts:
        return [whole[0] + step_s * n for n in range(int((whole[1] - whole[0]) / step_s))]
    before = int((starts[0] - whole[0]) / step_s + 1e-6)
    out = [starts[0] - step_s * n for n in range(before, 0, -1)]
    for one, other in itertools.pairwise(starts):
        places = (other - one) / step_s
        same = abs(places - round(places)) * step_s < _SAME_GRID_S
        out += [one + step_s * n for n in range(1, round(places) if same else int(places))]
    after = int((whole[1] - starts[-1]) / step_s + 1e-6)
    out += [starts[-1] + step_s * n for n in range(1, after)]
    return [round(start_s, 6) for start_s in out]


def misnumbered(arrived: list[Arrived]) -> int:
    """Count superframes whose number does not follow from that of the one before on their grid."""
    count = 0
    for one, other in itertools.pairwise(arrived):
        places = (other.start_s - one.start_s) / SUPERFRAME_S
        if abs(places - round(places)) * SUPERFRAME_S < _SAME_GRID_S:
            count += (other.number - one.number - round(places)) % other.numbers != 0
    return count
