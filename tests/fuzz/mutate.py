"""Inputs that never were: seeds with bytes changed, lines and numbers replaced, parts exchanged."""

import numpy as np

_NUMBERS = (
    b"0", b"-1", b"1e400", b"NaN", b"inf", b"-0.0", b"1e20", b"99999999999999999999", b"2147483648",
    b"65536", b"00:00:99,999", b"\xd9\xa1",
)  # fmt: skip
_BYTES = (0, 1, 0x7F, 0x80, 0xFF, 0x0A, 0x1B, 0x22)
_LONGEST = 1 << 18


def mutated(seeds: list[bytes], rng: np.random.Generator, *, text: bool) -> bytes:
    """Return one of the seeds after one to eight changes."""
    data = bytearray(seeds[int(rng.integers(len(seeds)))])
    for _ in range(int(rng.integers(1, 9))):
        at = int(rng.integers(len(data) + 1))
        size = min(len(data) - at, int(rng.integers(1, 1 + max(2, len(data) // 8))))
        match int(rng.integers(9 if text else 7)):
            case 0:
                for place in rng.integers(at, len(data), 3) if at < len(data) else ():
                    data[place] ^= 1 << int(rng.integers(8))
            case 1:
                data[at : at + 1] = bytes([_BYTES[int(rng.integers(len(_BYTES)))]])
            case 2:
                del data[at : at + size]
            case 3:
                data[at:at] = data[at : at + size] * int(rng.integers(1, 4))
            case 4:
                data[at : at + size] = rng.bytes(size)
            case 5:
                other = seeds[int(rng.integers(len(seeds)))]
                begin = int(rng.integers(len(other) + 1))
                data[at:] = other[begin:]
            case 6:
                width = int(rng.choice((2, 4, 8)))
                value = int(rng.choice((0, 1, 255, 1 << 15, (1 << 31) - 1, (1 << 32) - 1)))
                data[at : at + width] = (value & (1 << 8 * width) - 1).to_bytes(width, "little")
            case 7:
                data[at : at + size] = _NUMBERS[int(rng.integers(len(_NUMBERS)))]
            case _:
                lines = bytes(data).split(b"\n")
                rng.shuffle(lines)
                data = bytearray(b"\n".join(lines))
        del data[_LONGEST:]
    return bytes(data)
