"""The slow channel: a few lasting facts about a stream, repeated in pieces of 16 bits.

A piece names a register and its value, eight bits each. It stands alone: pieces may be lost, come
in any order and be ignored. Specification: spec/bitstream.md, sections 3.3 and 10.
"""

import itertools
import re
from collections.abc import Mapping

from codec.cues.language import Language
from codec.errors import CueError

N_REGISTERS = 256
"""Registers that a piece's first byte distinguishes."""

PROGRAMME = range(4)
"""Registers of the programme's identifier, its highest byte first."""

STREAM = 4
"""Register of the stream's number (X3)."""

LANGUAGE = range(5, 7)
"""Registers of the language's two letters (X4)."""

CODING = range(8, 16)
"""Registers of the coding's identity, its highest byte first (X5)."""

CORRECTIONS = range(16, 128)
"""Registers for corrections of the voice."""

HOST = range(128, 160)
"""Registers of the name of the host that has the voice (X5)."""

PRIVATE = range(192, 256)
"""Registers whose meaning parties agree on among themselves (X2)."""

_OPEN = {*PROGRAMME, STREAM, *LANGUAGE, *CODING, *CORRECTIONS, *HOST, *PRIVATE}

PERIOD = 8
"""Superframes from one piece to the next."""


def programme_registers(number: int) -> dict[int, int]:
    """Return the registers of a programme's identifier of 32 bits.

    Examples
    --------
    >>> programme_registers(0x01020304)
    {0: 1, 1: 2, 2: 3, 3: 4}
    """
    assert 0 <= number < 1 << 32, f"programme {number} in 32 bits"
    return {register: number >> 8 * (3 - register) & 255 for register in PROGRAMME}


def language_registers(code: str) -> dict[int, int]:
    """Return the registers of a language, two small letters (ISO 639-1).

    Examples
    --------
    >>> language_registers("en")
    {5: 101, 6: 110}
    """
    if not re.fullmatch("[a-z]{2}", code):
        raise CueError(f"language {code!r} is not two small letters (ISO 639-1)")
    return dict(zip(LANGUAGE, code.encode("ascii"), strict=True))


def voice_registers(coding: str, host: str = "") -> dict[int, int]:
    """Return the registers of a coding's identity, and of the host that has its files.

    Examples
    --------
    >>> len(voice_registers("9508bed717aef097", "cue.example.org"))
    24
    """
    if not re.fullmatch(r"[a-z0-9.-]{0,32}", host):
        raise CueError(f"host {host!r}: up to 32 small letters, digits, hyphens and dots")
    registers = dict(zip(CODING, bytes.fromhex(coding), strict=True))
    if host:
        registers |= dict(zip(HOST, (host + "\0").encode("ascii"), strict=False))
    return registers


class SlowSender:
    """Pieces of some registers in turn.

    Parameters
    ----------
    registers : mapping of int to int
        Values 0..255 by number 0..255.

    Raises
    ------
    CueError
        If a register is reserved (X2).

    Examples
    --------
    >>> sender = SlowSender({0: 7, 3: 9})
    >>> [hex(sender.piece(k)) for k in (0, 8, 16)]
    ['0x7', '0x309', '0x7']
    >>> SlowSender({}).due(8)
    False
    """

    def __init__(self, registers: Mapping[int, int]) -> None:
        assert all(0 <= r < N_REGISTERS and 0 <= v < 256 for r, v in registers.items())
        reserved = sorted(set(registers) - _OPEN)
        if reserved:
            raise CueError(f"register {reserved[0]} of the slow channel is reserved (X2)")
        self._pieces = [register << 8 | value for register, value in sorted(registers.items())]

    def due(self, index: int) -> bool:
        """Return whether superframe `index` carries a piece."""
        return bool(self._pieces) and index % PERIOD == 0

    def piece(self, index: int) -> int:
        """Return the piece that superframe `index` carries, if it carries one."""
        return self._pieces[index // PERIOD % len(self._pieces)]


class SlowReceiver:
    """Registers from the pieces that arrived; malformed ones mean nothing (X4, X5)."""

    def __init__(self) -> None:
        self.registers: dict[int, int] = {}

    def take(self, piece: int) -> None:
        """Take a piece of 16 bits."""
        self.registers[piece >> 8] = piece & 255

    @property
    def programme(self) -> int | None:
        """The programme's identifier, None until all of it has arrived.

        Examples
        --------
        >>> receiver = SlowReceiver()
        >>> for register, value in programme_registers(77).items():
        ...     receiver.take(register << 8 | value)
        >>> receiver.programme
        77
        """
        values = self._values(PROGRAMME)
        return None if values is None else int.from_bytes(values, "big")

    @property
    def stream(self) -> int:
        """The stream's number among those of the programme."""
        return self.registers.get(STREAM, 0)

    @property
    def language(self) -> str | None:
        """The language's two letters."""
        values = self._values(LANGUAGE) or b""
        return values.decode("ascii") if re.fullmatch(b"[a-z]{2}", values) else None

    @property
    def coding(self) -> str | None:
        """The coding's identity, sixteen hexadecimal digits."""
        values = self._values(CODING)
        return None if values is None else values.hex()

    @property
    def host(self) -> str | None:
        """The host that has the files of the coding."""
        known = [self.registers.get(register) for register in HOST]
        letters = bytes(itertools.takewhile(bool, (value or 0 for value in known)))
        ended = len(letters) == len(HOST) or known[len(letters)] == 0
        named = ended and re.fullmatch(rb"[a-z0-9.-]+", letters)
        return letters.decode("ascii") if named else None

    def _values(self, registers: range) -> bytes | None:
        """Return the values of registers, None until all have arrived."""
        found = [self.registers.get(register) for register in registers]
        return bytes(value or 0 for value in found) if None not in found else None


SILENT = SlowSender({})
"""Says nothing."""


def usual_sender(language: Language, coding: str) -> SlowSender:
    """Return a stream's default registers: languages other than French are stated.

    Parameters
    ----------
    language : Language
    coding : str
        Identity of the coding.
    """
    if not language.code:
        return SILENT
    return SlowSender(language_registers(language.code) | voice_registers(coding))
