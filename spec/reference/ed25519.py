"""Signatures of announcements: Ed25519 of RFC 8032, in affine numbers, slow on purpose (E16)."""

from hashlib import sha512

P = 2**255 - 19
ORDER = 2**252 + 27742317777372353535851937790883648493
D = -121665 * pow(121666, -1, P) % P
Point = tuple[int, int]


def add(a: Point, b: Point) -> Point:
    """Return the sum of two points of the curve -x^2 + y^2 = 1 + D x^2 y^2."""
    both = D * a[0] * b[0] * a[1] * b[1]
    x = (a[0] * b[1] + b[0] * a[1]) * pow(1 + both, -1, P)
    y = (a[1] * b[1] + a[0] * b[0]) * pow(1 - both, -1, P)
    return x % P, y % P


def times(count: int, point: Point) -> Point:
    """Return a point added to itself so many times."""
    total = (0, 1)
    for bit in f"{count:b}":
        total = add(total, total)
        if bit == "1":
            total = add(total, point)
    return total


def packed(point: Point) -> bytes:
    """Return a point as 32 bytes, lowest first; the highest bit is the parity of x."""
    return (point[1] | (point[0] & 1) << 255).to_bytes(32, "little")


def unpacked(data: bytes) -> Point | None:
    """Return the point of 32 bytes, None if there is none."""
    value = int.from_bytes(data, "little")
    parity, y = value >> 255, value & (1 << 255) - 1
    square = (y * y - 1) * pow(D * y * y + 1, -1, P) % P
    x = pow(square, (P + 3) // 8, P)
    if x * x % P != square:
        x = x * pow(2, (P - 1) // 4, P) % P
    if y >= P or x * x % P != square or (x == 0 and parity):
        return None
    return (x if x & 1 == parity else P - x), y


_base = unpacked((4 * pow(5, -1, P) % P).to_bytes(32, "little"))
assert _base is not None
BASE: Point = _base


def _digest(*parts: bytes) -> int:
    return int.from_bytes(sha512(b"".join(parts)).digest(), "little")


def _secrets(secret: bytes) -> tuple[int, bytes]:
    digest = sha512(secret).digest()
    scalar = int.from_bytes(digest[:32], "little") & (1 << 254) - 8 | 1 << 254
    return scalar, digest[32:]


def public_key_of(secret: bytes) -> bytes:
    """Return the public key, 32 bytes, of a secret of 32 bytes."""
    return packed(times(_secrets(secret)[0], BASE))


def sign(secret: bytes, message: bytes) -> bytes:
    """Return the signature of a message, 64 bytes."""
    scalar, prefix = _secrets(secret)
    nonce = _digest(prefix, message) % ORDER
    head = packed(times(nonce, BASE))
    challenge = _digest(head, public_key_of(secret), message)
    return head + ((nonce + challenge * scalar) % ORDER).to_bytes(32, "little")


def holds(public_key: bytes, message: bytes, signature: bytes) -> bool:
    """Return whether a signature is that of a message."""
    owner, head = unpacked(public_key), unpacked(signature[:32])
    scalar = int.from_bytes(signature[32:], "little")
    if owner is None or head is None or scalar >= ORDER:
        return False
    challenge = _digest(signature[:32], public_key, message) % ORDER
    return times(scalar, BASE) == add(head, times(challenge, owner))
