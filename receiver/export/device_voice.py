"""One file of tables and voice for receivers that have neither Python nor ZIP.

In: a voice with its coding tables. Out: the bytes that `receiver/native/src/voice.c` reads, whose
head states the layout: numbers in byte planes, so that a general compressor does well, and a
SHA-256 of all. The regression of the hand, two thirds of a voice, stands in whole 2**-12 mm;
everything else is exact. Arrays that only senders use are left out.
"""

import hashlib
import struct
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.cuer.voice import arrays_of as voice_arrays
from codec.cues.language import french
from codec.errors import VoiceError
from codec.superframe.coding import arrays_of as coding_arrays
from codec.superframe.coding import coding_for
from codec.superframe.tables import present_tables

MAGIC, LAYOUT = b"CUEVOICE", 1
DIGEST_BYTES = 32
"""Of SHA-256."""

STEP_MM = 2.0**-12
"""Unit of the regression's numbers: half of it, summed over all terms, stays below 0.01 mm."""

MOST_PARAMETERS = 31
"""Parameters of a voice that the receiver has room for (`CUE_PARAMETERS` of its header)."""

_SCORE = (
    "first", "next", "left", "length", "opening", "pause", "usual", "key", "gap", "held", "alone",
)  # fmt: skip
_COEFFICIENT = ("magnitude", "inset")
_FOR_SENDERS = (
    "hand.deviations",
    "gestures.shape_targets",
    "gestures.placement_targets",
    "gestures.neutral_head",
)
_NONE = 255
"""Byte of a phone that has no shape or no placement."""

Arrays = Mapping[str, NDArray[Any]]


def device_voice(voice: Voice) -> bytes:
    """Return the file of a voice.

    Raises
    ------
    VoiceError
        If the voice has more parameters than receivers have room for, or cues another language
        than French, whose tables are of other sizes.
    """
    if voice.language != french():
        raise VoiceError(
            f"voice {voice.name} cues {voice.language.name}: "
            "devices and web pages have room for the tables of French only"
        )
    coding = coding_for(voice)
    return packed(
        dict(voice_arrays(voice)), dict(coding_arrays(coding)), coding.identity, voice.identity
    )


def packed(voice: Arrays, coding: Arrays, coding_identity: str, voice_identity: str) -> bytes:
    """Return the file of arrays under their names in the specification.

    Parameters
    ----------
    voice, coding : mapping of str to ndarray
        Of paragraph O2, and of table 4.
    coding_identity, voice_identity : str
        Sixteen hexadecimal digits each.

    Raises
    ------
    VoiceError
        If the voice has more parameters than receivers have room for.
    """
    count = len(coding["mean"])
    if count > MOST_PARAMETERS:
        raise VoiceError(f"{count} parameters, receivers have room for {MOST_PARAMETERS}")
    body = b"".join([*_tables(), *_coding_planes(coding), *_voice_planes(voice)])
    size = 40 + len(body) + DIGEST_BYTES
    widths = (
        len(voice["face.motion_directions"]),
        len(voice["hand.motion_directions"]),
        len(voice["hand.angle_mean"]),
    )
    head = MAGIC + struct.pack("<4H", LAYOUT, *widths)
    head += bytes.fromhex(coding_identity) + bytes.fromhex(voice_identity)
    whole = head + struct.pack("<2I", size, 0) + body
    return whole + hashlib.sha256(whole).digest()


def _tables() -> Iterator[bytes]:
    document = present_tables()
    for name in _SCORE:
        yield planes(np.array(document["score"][name], dtype="<i2"))
    for name in _COEFFICIENT:
        yield planes(np.array(document["coefficient"][name], dtype="<i2"))
    language = document["language"]
    phones, places = language["phones"], language["placements"]
    yield bytes(language["shape"].get(phone, _NONE) for phone in phones)
    placement = language["placement"]
    yield bytes(places.index(placement[p]) if p in placement else _NONE for p in phones)
    alone = places.index(language["placement_without_vowel"])
    yield bytes([language["shape_without_consonant"], alone])


def _coding_planes(coding: Arrays) -> Iterator[bytes]:
    for name, array in coding.items():
        yield planes(array.astype("<i2" if name.endswith("scales") else "<f4"))


def _voice_planes(voice: Arrays) -> Iterator[bytes]:
    for name, array in voice.items():
        if name == "hand.regression":
            units = np.rint(array.astype(np.float64) / STEP_MM).astype(np.int64)
            packed_units = np.where(units < 0, -2 * units - 1, 2 * units)
            if packed_units.max() >= 1 << 24:
                raise VoiceError(f"{name} reaches {np.abs(array).max():.0f} mm, the limit is 2047")
            yield planes(packed_units.astype("<u4"))[: 3 * array.size]
        elif name not in _FOR_SENDERS:
            yield planes(array.astype("<f4"))


def planes(array: NDArray[Any]) -> bytes:
    """Return the lowest byte of all numbers, then the next byte of all, and so on.

    Examples
    --------
    >>> planes(np.array([1, 258], dtype="<u2")).hex()
    '01020001'
    """
    flat = np.ascontiguousarray(array).reshape(-1)
    return flat.view(np.uint8).reshape(-1, array.itemsize).T.tobytes()
