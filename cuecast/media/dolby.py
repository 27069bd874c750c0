"""Metadata of AC-3 for players: loudness of speech, and how to downmix to two channels.

Frames in, options of FFmpeg's encoders out: a sound that is coded again has to be as loud on every
set as it was. Source: ETSI TS 102 366, sections 4.4.2 (bit stream information) and E.1.2.
"""

import os
from collections.abc import Iterable
from typing import Any

from receiver.media.programme import open_programme

TELLING = ("ac3", "eac3")
"""Encoders that can state it."""

_SYNC = b"\x0b\x77"

_ENHANCED_FROM = 11
"""Least identification of a bit stream (bsid) of Enhanced AC-3."""

_CENTRE = ("0.707", "0.595", "0.5")
"""Share of the centre in two channels by code."""

_SURROUND = ("0.707", "0.5", "0")
"""Share of the surrounds in two channels by code."""

_PACKETS = 200
"""So many packets are looked at for a first whole frame."""


def settings_of(frame: bytes) -> dict[str, str]:
    """Return the encoder options that reproduce a frame's metadata.

    Parameters
    ----------
    frame : bytes
        Of AC-3 or Enhanced AC-3; others have no such metadata.

    Examples
    --------
    >>> settings_of(bytes.fromhex("0b7700001e4043600000"))
    {'dialnorm': '-27'}
    """
    if len(frame) < 8 or frame[:2] != _SYNC:
        return {}
    fields = _Fields(frame[5:])
    if fields.take(5) >= _ENHANCED_FROM:
        return {"dialnorm": _level(fields.take(5))}
    fields.take(3)
    mode = fields.take(3)
    settings = {}
    for present, name, shares in (
        (mode & 1 and mode != 1, "center_mixlev", _CENTRE),
        (mode & 4, "surround_mixlev", _SURROUND),
    ):
        if present and (code := fields.take(2)) < len(shares):
            settings[name] = shares[code]
    if mode == 2:
        fields.take(2)
    fields.take(1)
    return {"dialnorm": _level(fields.take(5))} | settings


def first_settings(source: str | os.PathLike[str], track: int) -> dict[str, str]:
    """Return the settings of a file's sound with this number, none if it is no such sound."""
    with open_programme(source, track=track) as programme:
        if programme.format.codec not in TELLING:
            return {}
        packets: Iterable[Any] = programme.container.demux(programme.sound)
        for _, packet in zip(range(_PACKETS), packets, strict=False):
            if packet.size and (found := settings_of(bytes(packet))):
                return found
    return {}


def _level(code: int) -> str:
    return str(-code if code else -31)


class _Fields:
    """Bits of a frame, the first ones first."""

    def __init__(self, data: bytes) -> None:
        self._bits = "".join(f"{byte:08b}" for byte in data[:8])

    def take(self, count: int) -> int:
        out, self._bits = self._bits[:count], self._bits[count:]
        return int(out, 2)
