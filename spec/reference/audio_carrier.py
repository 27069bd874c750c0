"""Decoder of spec/audio-carrier.md for one superframe whose place is known, from the text.

Standard library only, slow on purpose: samples in, bytes out, by hard decisions on the soft values
that the simple successive-cancellation decoder takes.
"""

import cmath
import hashlib
import itertools
import math
from functools import lru_cache

HOP = 480
FRAMES = 64
PROFILES = {
    "robust": (0, 4, 2, 102, 1.75, 7, 0, 1344),
    "standard": (1, 4, 6, 158, 1.0, 20, 7, 1536),
    "high": (2, 2, 6, 238, 0.75, 20, 36, 2816),
    "discreet": (3, 4, 2, 134, 1.0, 12, 0, 1856),
}
"""(W39) Number, bins of a cell, first and last bin, strength, bytes of L0 and L1, coded L0."""


def words(purpose: str, key: int, count: int) -> list[int]:
    """(W10) Words of a stream."""
    raw = hashlib.shake_256(f"cuecast audio 1/{purpose}/{key}".encode("ascii")).digest(4 * count)
    return [int.from_bytes(raw[4 * i : 4 * i + 4], "little") for i in range(count)]


def signs(purpose: str, key: int, count: int) -> list[int]:
    """(W11) Signs of a stream."""
    return [-1 if word % 2 else 1 for word in words(purpose, key, count)]


def order(drawn: list[int]) -> list[int]:
    """(W12) Order by drawn words."""
    return sorted(range(len(drawn)), key=lambda i: (drawn[i], i))


def pilot_slots(key: int) -> list[list[int]]:
    """(W14) Slots of the pilots of each frame."""
    drawn = words("pilot slots", key, 6 * FRAMES)
    return [order(drawn[6 * f : 6 * f + 6])[:2] for f in range(FRAMES)]


def data_cells(profile: str, key: int) -> list[tuple[int, int]]:
    """(W16, W17) Frame and cell of each coded bit."""
    number, bins, first, last = PROFILES[profile][:4]
    slots = pilot_slots(key)
    usable = [
        (f, g)
        for f in range(FRAMES)
        for g in range((last - first) // bins)
        if (first + g * bins - 6) // 8 not in slots[f]
    ]
    return [usable[i] for i in order(words(f"data {number} interleaver", key, len(usable)))]


def fft(x: list[complex]) -> list[complex]:
    """Discrete Fourier transform, by the smallest prime factor of the length."""
    n = len(x)
    factor = next((p for p in (2, 3, 5) if n % p == 0), n)
    if n == 1:
        return x
    parts = [fft(x[r::factor]) for r in range(factor)]
    turn = [cmath.exp(-2j * math.pi * k / n) for k in range(n)]
    size = n // factor
    return [sum(turn[r * k % n] * parts[r][k % size] for r in range(factor)) for k in range(n)]


def spectrum(frame: list[float]) -> list[complex]:
    """(W8) Complex spectrum of 960 samples."""
    turned = [
        math.sin(math.pi * (n + 0.5) / 960) * x * cmath.exp(-1j * math.pi * n / 960)
        for n, x in enumerate(frame)
    ]
    return [
        math.sqrt(2 / HOP) * value * cmath.exp(-1j * math.pi / HOP * 240.5 * (k + 0.5))
        for k, value in enumerate(fft(turned)[:HOP])
    ]


def bark(frequency: float) -> float:
    """(W23) Critical-band rate."""
    return 13 * math.atan(0.00076 * frequency) + 3.5 * math.atan((frequency / 7500) ** 2)


@lru_cache(maxsize=1)
def bands() -> list[int]:
    """(W23) First bin of each band, and 480."""
    edges = [0]
    while edges[-1] < HOP:
        a = edges[-1]
        b = next((b for b in range(a, HOP) if bark(50 * b) >= bark(50 * a) + 0.5), HOP)
        edges.append(min(HOP, max(a + 5, b)))
    return edges


@lru_cache(maxsize=1)
def spread_matrix() -> list[list[float]]:
    """(W24, W25) Row j: what band j gets of each band's power."""
    edges = bands()
    centre = [bark(25 * (a + b)) for a, b in itertools.pairwise(edges)]
    matrix = []
    for cj in centre:
        gain = []
        for ci in centre:
            x = cj - ci + 0.474
            gain.append(10 ** (0.1 * (15.81 + 7.5 * x - 17.5 * math.sqrt(1 + x * x))))
        scale = 10 ** (-0.1 * max(3.0, cj / 4)) / sum(gain)
        matrix.append([g * scale for g in gain])
    return matrix


def thresholds(spectra: list[complex]) -> list[float]:
    """(W24 to W26) Threshold of each band of one frame."""
    edges = bands()
    power = [
        sum(abs(y) ** 2 / 2 for y in spectra[a:b]) / (b - a) for a, b in itertools.pairwise(edges)
    ]
    out = []
    for own, row in zip(power, spread_matrix(), strict=True):
        limit = 10**-0.6 * own
        spread = min(sum(g * e for g, e in zip(row, power, strict=True)), limit)
        out.append(0.0 if own < 10**-9.4 else min(1e-8 * (spread / 1e-8) ** 0.7, limit))
    return out


def units(now: list[float], before: list[float]) -> list[float]:
    """(W27, W28) Unit of each bin."""
    edges = bands()
    out: list[float] = []
    for band, (t, b) in enumerate(zip(now, before, strict=True)):
        limited = min(t, 4 * max(b, 1e-10))
        out += [math.sqrt(limited)] * (edges[band + 1] - edges[band])
    return out


def soft_values(samples: list[float], profile: str, key: int, level: int) -> list[float]:
    """(W18, W20, W22) Soft value of each coded bit.

    `samples`, 31680 of them, begin one hop before the superframe.
    """
    number, bins, first, last, strength = PROFILES[profile][:5]
    groups = (last - first) // bins
    sign = signs(f"data {number} signs", key, groups * bins)
    dither = [word / 2**32 for word in words(f"data {number} dither", key, groups)]
    step = strength * 2 ** (1.5 + level / 4)
    spectra = [spectrum(samples[HOP * t : HOP * t + 960]) for t in range(FRAMES + 1)]
    limits = [thresholds(frame) for frame in spectra]
    unit = [units(limits[t + 1], limits[t]) for t in range(FRAMES)]
    out = []
    for f, g in data_cells(profile, key):
        p = 0.0
        silent = False
        for i in range(g * bins, (g + 1) * bins):
            m = unit[f][first + i]
            silent = silent or m == 0
            p += 0.0 if silent else sign[i] * spectra[f + 1][first + i].real / m
        phase = p / math.sqrt(bins) / step - dither[g]
        out.append(0.0 if silent else math.cos(2 * math.pi * phase))
    return out


def check(bits: list[int], width: int) -> list[int]:
    """(W30) Check bits."""
    polynomial = {16: 0x1021, 24: 0x864CFB}[width]
    register = 2**width - 1
    for bit in bits:
        top = register >> (width - 1)
        register = (register << 1) % 2**width
        if top != bit:
            register ^= polynomial
    return [register >> (width - 1 - i) & 1 for i in range(width)]


def information(message: int, length: int) -> list[int]:
    """(W31, W32) Inputs that take the message."""
    size = 1 << (length.bit_length() - 1)

    def weight(i: int) -> float:
        return math.fsum(2 ** (j / 4) for j in range(size.bit_length()) if i >> j & 1)

    return sorted(sorted(range(size), key=lambda i: (weight(i), i))[size - message :])


def encode(payload: bytes, width: int, length: int) -> list[int]:
    """(W29 to W33) Coded bits of a class."""
    bits = [byte >> (7 - i) & 1 for byte in payload for i in range(8)]
    bits += check(bits, width)
    size = 1 << (length.bit_length() - 1)
    u = [0] * size
    for i, bit in zip(information(len(bits), length), bits, strict=True):
        u[i] = bit
    x = [0] * size
    for k in range(size):
        if u[k]:
            subset = k
            while True:  # all i whose set bits are among those of k
                x[subset] ^= 1
                if subset == 0:
                    break
                subset = (subset - 1) & k
    return [x[i % size] for i in range(length)]


def decode(ratios: list[float], size: int, width: int) -> bytes | None:
    """(W29 to W33) Payload of `size` bytes behind soft values, positive for 0; or None."""
    length = len(ratios)
    mother = 1 << (length.bit_length() - 1)
    folded = [sum(ratios[i::mother]) for i in range(mother)]
    taken = set(information(8 * size + width, length))
    message: list[int] = []

    def block(values: list[float], first: int) -> list[int]:
        """Codeword of the block whose first input is `first`; adds its message bits."""
        if len(values) == 1:
            bit = int(first in taken and values[0] < 0)
            if first in taken:
                message.append(bit)
            return [bit]
        half = len(values) // 2
        low, high = values[:half], values[half:]
        pairs = list(zip(low, high, strict=True))
        left = block([math.copysign(min(abs(a), abs(b)), a * b) for a, b in pairs], first)
        right = block(
            [b - a if bit else b + a for (a, b), bit in zip(pairs, left, strict=True)], first + half
        )
        return [a ^ b for a, b in zip(left, right, strict=True)] + right

    block(folded, 0)
    bits = message[: 8 * size]
    if check(bits, width) != message[8 * size :]:
        return None
    return bytes(
        sum(bit << (7 - i) for i, bit in enumerate(bits[8 * n : 8 * n + 8])) for n in range(size)
    )


def decode_superframe(
    samples: list[float], profile: str, key: int, level: int
) -> tuple[bytes | None, bytes | None]:
    """(W29, W34) Payloads L0 and L1 of the superframe that begins at sample 480 of `samples`."""
    l0_bytes, l1_bytes, l0_coded = PROFILES[profile][5:]
    soft = soft_values(samples, profile, key, level)
    l0 = decode(soft[:l0_coded], l0_bytes, 24)
    if l0 is None:
        return None, None
    return l0, decode(soft[l0_coded:], l1_bytes, 16) if l1_bytes else b""
