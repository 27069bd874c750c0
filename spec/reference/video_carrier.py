"""Sections 2 to 5 and the hard decisions of 6 of spec/video-carrier.md, from the text."""

import hashlib
import math

STEPS = (2.0, 2.8, 4.0)
"""(V2) Fine steps by number."""

COARSE, TEXTURE = 3, 2.0

PILOT_STEP = 2.8
PILOT_WIDTHS, PILOT_TEXTURES = (1, 3, 5), (2.0, 5.0)
"""(V27) Fine step of the pilots, widths of their lattices in it, and from which textures."""
ROWS, COLUMNS = 45, 80
VALUES = 2 * ROWS * COLUMNS
PILOTS = 320


def words(purpose: str, key: int, count: int) -> list[int]:
    """(V15) Words of a stream."""
    raw = hashlib.shake_256(f"cuecast audio 1/{purpose}/{key}".encode("ascii")).digest(4 * count)
    return [int.from_bytes(raw[4 * i : 4 * i + 4], "little") for i in range(count)]


def dither(key: int) -> list[float]:
    """(V16) Dither of every value."""
    return [word / 2**32 for word in words("video dither", key, VALUES)]


def positions(key: int) -> tuple[list[int], list[int]]:
    """(V17) Values of the pilots and of the data."""
    order = words("video positions", key, VALUES)
    ranked = sorted(range(VALUES), key=lambda i: (order[i], i))
    return sorted(ranked[:PILOTS]), ranked[PILOTS:]


def pilot_bits(number: int, step: int, key: int, superframe: int) -> list[int]:
    """(V18) Bits of the pilots of a superframe."""
    common = words("video pilot bits", key, PILOTS)
    own = words(f"video pilot bits {number + 8 * step}", key, PILOTS)
    return [((common if j % 5 < 3 else own)[j] ^ superframe) & 1 for j in range(PILOTS)]


def share(frame: int, fps: float) -> tuple[int, float]:
    """(V3, V4) Superframe of a frame and the part of its pattern that the frame bears."""
    time = (frame + 0.5) / fps / 0.64
    superframe, phase = int(time), time - int(time)
    if superframe == 0 and phase < 0.5:
        return 0, 1.0
    return superframe, min(1.0, 0.5 + 4 * min(phase, 1 - phase))


def window(superframe: int, fps: float) -> range:
    """(V5) Frames of a superframe's window."""
    length = round(0.48 * fps)
    start = round(0.64 * fps * superframe + (0.64 * fps - length) / 2)
    return range(start, start + length)


def amplitude(luma: list[list[int]], value: int) -> float:
    """(V7 to V10) Amplitude of one template in one cell of a picture of 8 bits."""
    template, row, column = value // (ROWS * COLUMNS), value // COLUMNS % ROWS, value % COLUMNS
    across = _places(len(luma[0]), COLUMNS, column)
    down = _places(len(luma), ROWS, row)
    dipole = across if template == 0 else down
    mean = sum(math.sin(2 * math.pi * p) for p in dipole.values()) / len(dipole)
    total = norm = 0.0
    for y, b in down.items():
        for x, a in across.items():
            first, second = (a, b) if template == 0 else (b, a)
            weight = (math.sin(2 * math.pi * first) - mean) * math.sin(math.pi * second) ** 2
            total += luma[y][x] * weight
            norm += weight**2
    return total / norm


def _places(size: int, cells: int, cell: int) -> dict[int, float]:
    """(V7) Pixels of a cell along one axis and their places in it."""
    places = {x: (x + 0.5) * cells / size for x in range(size)}
    return {x: u - cell for x, u in places.items() if int(u) == cell}


def texture(luma: list[list[int]], row: int, column: int) -> float:
    """(V13) Texture of a cell of a picture of 8 bits."""
    rows = [list(_places(len(luma), 4 * ROWS, 4 * row + i)) for i in range(4)]
    columns = [list(_places(len(luma[0]), 4 * COLUMNS, 4 * column + j)) for j in range(4)]
    deviations = []
    for i in (0, 2):
        for j in (0, 2):
            means = []
            for down in rows[i : i + 2]:
                for across in columns[j : j + 2]:
                    values = [luma[y][x] for y in down for x in across]
                    means.append(sum(values) / len(values))
            mean = sum(means) / 4
            deviations.append(math.sqrt(sum((m - mean) ** 2 for m in means) / 4))
    return min(deviations)


def width_of(texture_of_cell: float) -> int:
    """(V2, V13) How many fine steps the lattice of a cell is wide."""
    return COARSE if texture_of_cell > TEXTURE else 1


def pilot_width_of(texture_of_cell: float) -> int:
    """(V27) The same for a pilot, in the pilots' fine steps."""
    return PILOT_WIDTHS[sum(texture_of_cell > limit for limit in PILOT_TEXTURES)]


def hard_bit(mean_amplitude: float, dither_of_value: float, step: float, width: int) -> int:
    """(V11) The bit whose lattice is nearer."""
    place = (mean_amplitude / step - dither_of_value) * 2 / width
    return round(place) % 2
