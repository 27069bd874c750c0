"""The slow channel: a few lasting facts about a stream, told over and over in pieces of 16 bits.

A piece names a register and its value, eight bits each. It stands alone: pieces may be lost, come
in any order and be ignored. Specification: spec/bitstream.md, section 3.3.
"""

from collections.abc import Mapping

N_REGISTERS = 256
"""Registers that a piece's first byte tells apart."""

PROGRAMME = range(4)
"""Registers of the programme's identifier, its highest byte first."""

PERIOD = 8
"""Superframes from one piece to the next."""


def programme_registers(number: int) -> dict[int, int]:
    """Return the registers that tell a programme's identifier of 32 bits.

    Examples
    --------
    >>> programme_registers(0x01020304)
    {0: 1, 1: 2, 2: 3, 3: 4}
    """
    assert 0 <= number < 1 << 32, f"programme {number} in 32 bits"
    return {register: number >> 8 * (3 - register) & 255 for register in PROGRAMME}


class SlowSender:
    """Pieces of some registers in turn.

    Parameters
    ----------
    registers : mapping of int to int
        Values 0..255 by number 0..255.

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
        self._pieces = [register << 8 | value for register, value in sorted(registers.items())]

    def due(self, index: int) -> bool:
        """Return whether superframe `index` carries a piece."""
        return bool(self._pieces) and index % PERIOD == 0

    def piece(self, index: int) -> int:
        """Return the piece that superframe `index` carries, if it carries one."""
        return self._pieces[index // PERIOD % len(self._pieces)]


class SlowReceiver:
    """What the pieces that arrived say."""

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
        if any(register not in self.registers for register in PROGRAMME):
            return None
        return int.from_bytes(bytes(self.registers[register] for register in PROGRAMME), "big")


SILENT = SlowSender({})
"""Says nothing."""
