"""The subtitles inside a programme: which tracks there are, and the text of one.

Text tracks (mov_text, SubRip, WebVTT, ASS, TTML) become `Subtitle` values on the programme's
clock, through the same readers as subtitle files. Tracks of pictures and of codings that nothing
here can read are named as what they are.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from av.stream import Disposition

from codec.errors import CueError
from cuecast.media.tables import PACKET, SYNC, TableReader, synchronised
from cuecast.media.text_files import Cue, file_of
from cuecast.media.timed_text import document_of, paragraph_of, placed, subtitles_of_packet
from receiver.media.programme import open_programme
from synth.language.subtitles import Subtitle
from synth.language.subtitles.read import USUAL, OnLeftOut, Terms, cued_subtitles, parse_subtitles

_NAMES = {
    "mov_text": "mov_text", "srt": "SubRip", "subrip": "SubRip", "text": "text",
    "webvtt": "WebVTT", "ssa": "ASS", "ass": "ASS", "ttml": "TTML",
}  # fmt: skip
"""Codecs of text that are read."""

_PICTURES = {
    "dvbsub": "DVB bitmaps",
    "pgssub": "PGS bitmaps",
    "dvdsub": "DVD bitmaps",
    "xsub": "XSUB bitmaps",
}
_UNREAD = {"teletext": "teletext", "arib captions": "ARIB captions", "cc_dec": "CEA-608 captions"}

FRENCH = {"fra", "fre", "fr"}
_UNTOLD = {"", "und", "mul", "qaa"}

_SCANNED_BYTES = 4 << 20
"""Bytes of a transport stream that have to bring its tables and a text."""

_SCANNED_PACKETS = 400
"""Packets that are looked at for tracks."""

_LONGEST_S = 7.0
"""How long a text stays without an end of its own and without a next one."""


@dataclass(frozen=True, slots=True)
class TextTrack:
    """A track of subtitles in a programme.

    Attributes
    ----------
    number : int
        Among the programme's tracks of subtitles, from 0.
    index : int
        Of the container's stream.
    coding : str
        Name of the track's coding, in words.
    language : str
        Code as the container states it, or nothing.
    title : str
    readable : bool
        Whether it is text that can be read.
    forced, default : bool
        Whether it only has passages in other languages; whether players show it first.
    """

    number: int
    index: int
    coding: str
    language: str
    title: str
    readable: bool
    forced: bool
    default: bool

    def __str__(self) -> str:
        label = f"{self.number}: {self.coding}"
        if self.language not in _UNTOLD:
            label += f", {self.language}"
        if self.title:
            label += f", {self.title!r}"
        return label if self.readable else f"{label} (cannot be read as text)"


def text_tracks(path: str | os.PathLike[str]) -> list[TextTrack]:
    """Return the tracks of subtitles of a programme, text or not.

    Raises
    ------
    CueError
        If it is not a programme.
    """
    with open_programme(path) as programme:
        container = programme.container
        told = _told_by_tables(path) if container.format.name == "mpegts" else {}
        found = []
        unnamed = []
        for stream in container.streams:
            kind, language = told.get(stream.id, ("", ""))
            coding = _coding(stream, kind)
            if coding or stream.type in ("subtitle", "data"):
                found.append((stream, coding, stream.metadata.get("language", language)))
                if not coding:
                    unnamed.append(stream)
        sniffed = _sniff(container, unnamed)
        tracks: list[TextTrack] = []
        for stream, coding, language in found:
            coding = coding or sniffed.get(stream.index, "")
            if coding or stream.type == "subtitle":
                title = stream.metadata.get("title", "")
                tracks.append(
                    TextTrack(
                        len(tracks),
                        stream.index,
                        coding or "subtitles of an unknown coding",
                        language.lower(),
                        title,
                        coding in _NAMES.values(),
                        Disposition.forced in stream.disposition or "forced" in title.lower(),
                        Disposition.default in stream.disposition,
                    )
                )
    return tracks


def choose_track(tracks: list[TextTrack], wanted: str | None, name: str) -> TextTrack:
    """Return the track that is meant: by its number or language, else the French one.

    Parameters
    ----------
    tracks : list of TextTrack
    wanted : str, optional
        Number from 0, or code of a language.
    name : str
        What error messages call the programme.

    Raises
    ------
    CueError
        If there is none, or it is not text.
    """
    listed = "; ".join(map(str, tracks))
    texts = [track for track in tracks if track.readable]
    if not tracks:
        inside = " that can be seen (timed text of MXF cannot)" if _is_mxf(name) else ""
        raise CueError(f"{name}: no subtitles in it{inside}: give them with --subtitles")
    if wanted is not None:
        meant = [t for t in tracks if wanted in (str(t.number), t.language)]
        meant = meant or [t for t in texts if _alike(wanted, t.language)]
        if not meant:
            raise CueError(f"{name}: no subtitle track {wanted!r}, it has {listed}")
        track = min(meant, key=_order)
        if not track.readable:
            raise CueError(f"{name}: subtitle track {track}: give a file with --subtitles")
        return track
    if not texts:
        raise CueError(f"{name}: no text among its subtitles ({listed}): give it with --subtitles")
    french = [t for t in texts if t.language.split("-")[0] in FRENCH]
    untold = [t for t in texts if t.language in _UNTOLD]
    if not french and not untold:
        raise CueError(f"{name}: no French subtitles ({listed}): choose with --subtitle-track")
    return min(french or untold, key=_order)


def _is_mxf(name: str) -> bool:
    return name.lower().endswith(".mxf")


def player_s_of(path: str | os.PathLike[str]) -> float:
    """Return the time of a programme's clock's zero on the clock of a player, seconds."""
    with open_programme(path) as programme:
        return programme.player_s


def read_track(
    path: str | os.PathLike[str],
    track: TextTrack,
    *,
    terms: Terms = USUAL,
    left_out: OnLeftOut = lambda item: None,
) -> list[Subtitle]:
    """Return the subtitles of a track, on the programme's clock, sorted by their start.

    Parameters
    ----------
    path : path
    track : TextTrack
    terms, left_out
        As in `synth.language.subtitles.read.parse_subtitles`; lines are those of the track as a
        file of its format, or the numbers of TTML's subtitles.

    Raises
    ------
    CueError
        If there is no text in it.
    """
    with open_programme(path) as programme:
        stream = programme.container.streams[track.index]
        origin_s = programme.origin_s
        packets = [
            (
                float(p.pts * p.time_base) - origin_s,
                float((p.duration or 0) * p.time_base),
                bytes(p),
            )
            for p in programme.packets()
            if p.stream.index == track.index and p.pts is not None
        ]
        # In a transport stream the packets' clock has nothing to do with a document's.
        zero_s = 0.0 if programme.container.format.name == "mpegts" else -origin_s
        header = bytes(getattr(stream.codec_context, "extradata", None) or b"")
    # The track is on the programme's clock: there is no tape's hour to guess.
    terms = replace(terms, offset_s=terms.offset_s or 0.0)
    empty = CueError(f"{path}: subtitle track {track}: it is empty")
    try:
        if track.coding == "TTML":
            found = sorted(_documents(packets, zero_s), key=lambda s: s.start_s)
            if not found:
                raise empty
            numbered = [replace(one, line=number) for number, one in enumerate(found, 1)]
            return cued_subtitles(numbered, terms=terms, left_out=left_out)
        cues = list(_cues(packets))
        if not cues:
            raise empty
        data = file_of(track.coding, cues, header)
        return parse_subtitles(data, terms=terms, left_out=left_out)
    except CueError as error:
        if error is empty:
            raise
        raise CueError(f"{path}: subtitle track {track.number}: {error}") from error


def _alike(wanted: str, language: str) -> bool:
    both = {wanted.lower(), language.split("-")[0]}
    return len(both) == 1 or both <= FRENCH


def _order(track: TextTrack) -> tuple[bool, bool, int]:
    return track.forced, not track.default, track.number


def _coding(stream: Any, kind: str) -> str:
    """Name of a track's coding as the container states it, nothing where it does not."""
    if kind == "ttml":
        return "TTML"
    if kind in _UNREAD:
        return _UNREAD[kind]
    if kind == "dvb bitmaps":
        return "DVB bitmaps"
    if stream.type != "subtitle" or stream.codec_context is None:
        return ""
    name = stream.codec_context.name
    return _NAMES.get(name) or _PICTURES.get(name) or _UNREAD.get(name) or f"{name} subtitles"


def _told_by_tables(path: str | os.PathLike[str]) -> dict[int, tuple[str, str]]:
    """Kind and language of each PID of a transport stream, by its first map."""
    with Path(path).open("rb") as file:
        data = file.read(_SCANNED_BYTES)
    start = synchronised(data)
    reader = TableReader()
    for at in range(start, len(data) - PACKET + 1, PACKET):
        if data[at] == SYNC and reader.process(data[at : at + PACKET]):
            break
    streams = reader.programme.streams if reader.programme is not None else ()
    return {stream.pid: (stream.kind, stream.language) for stream in streams}


def _sniff(container: Any, streams: list[Any]) -> dict[int, str]:
    """Name the coding of streams by what their first packets hold: TTML, or nothing."""
    found: dict[int, str] = {}
    if not streams:
        return found
    for _, packet in zip(range(_SCANNED_PACKETS), container.demux(streams), strict=False):
        if packet.size and (document_of(bytes(packet)) or paragraph_of(bytes(packet))):
            found[packet.stream.index] = "TTML"
        if len(found) == len(streams):
            break
    return found


_Packet = tuple[float, float, bytes]


def _cues(packets: list[_Packet]) -> Iterator[Cue]:
    """Yield packets that hold one text each, with their ends, cut to the programme."""
    for place, (start_s, length_s, data) in enumerate(packets):
        if not length_s:
            following_s = (
                packets[place + 1][0] if place + 1 < len(packets) else start_s + _LONGEST_S
            )
            length_s = min(following_s - start_s, _LONGEST_S)
        start_s, end_s = max(0.0, start_s), start_s + length_s
        if data.strip(b"\x00") and round(end_s, 3) > round(start_s, 3):
            yield start_s, end_s, data


def _documents(packets: list[_Packet], zero_s: float) -> Iterator[Subtitle]:
    """Yield the texts of packets of TTML, each text once."""
    alone = [packet for packet in packets if not document_of(packet[2])]
    for start_s, end_s, data in _cues(alone):
        yield from placed(start_s, end_s, Subtitle(0.0, 1.0, paragraph_of(data)))
    seen: set[Subtitle] = set()
    for start_s, _, data in packets:
        for one in subtitles_of_packet(data, start_s, zero_s):
            if one not in seen:
                seen.add(one)
                yield one
