"""The two files of a broadcaster's key: the secret one, and what receivers are given.

The public file holds an Ed25519 key (RFC 8032, by the library `cryptography`), the ends of all
chains for some time, and a signature over both. A file that continues an earlier one is signed by
the same key, and can come from anywhere. Specification: spec/authentication.md, section 4.
"""

import base64
import binascii
import hashlib
import json
import os
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from codec.authentication.chain import Chain, keys_of
from codec.authentication.layout import KEY_BYTES, LAYOUTS, PERIOD, SUPERFRAME_S, number_at
from codec.errors import CueError

_FORMAT = "cuecast-key-1"

_MOST_BYTES = 16 << 20
"""Bytes of a key's file at most."""

_MOST_PERIODS = 30 * 366 * 24
"""Periods of an hour that a key may hold for: thirty years."""

_LONGEST_NAME = 80
"""Letters of a channel's name at most."""


@dataclass(frozen=True, slots=True)
class Announcement:
    """What a receiver that trusts a broadcaster has of him.

    Attributes
    ----------
    name : str
        As the broadcaster calls himself.
    public_key : bytes
        Ed25519, 32 bytes.
    first_period : int
        Of those for which ends of chains are given.
    ends : dict of int to bytes
        By the width of the proof fields: 8 bytes per period, what comes before its first key.
    signature : bytes
        Ed25519 over all else, 64 bytes.
    """

    name: str
    public_key: bytes
    first_period: int
    ends: dict[int, bytes]
    signature: bytes

    @property
    def channel(self) -> bytes:
        """What separates this broadcaster's chains from all others."""
        return hashlib.sha256(self.public_key).digest()[:8]

    @property
    def fingerprint(self) -> str:
        """The public key's SHA-256 in groups of four digits, for reading out."""
        digits = hashlib.sha256(self.public_key).hexdigest()[:32]
        return " ".join(digits[at : at + 4] for at in range(0, 32, 4))

    @property
    def periods(self) -> range:
        """Periods for which it holds."""
        return range(self.first_period, self.first_period + len(self.ends[9]) // KEY_BYTES)

    def end_of(self, period: int, width: int) -> bytes | None:
        """Return the end of a period's chain, None outside `periods`."""
        if period not in self.periods:
            return None
        at = (period - self.first_period) * KEY_BYTES
        return self.ends[width][at : at + KEY_BYTES]

    def chain(self, period: int, width: int) -> Chain:
        """Return a period's chain."""
        return Chain(self.channel, period, width)

    def continues(self, other: "Announcement") -> bool:
        """Return whether the same key signed both."""
        return self.public_key == other.public_key

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the public file."""
        _save(path, _document(self) | {"signature": _text(self.signature)})


@dataclass(frozen=True, slots=True)
class SigningKey:
    """A broadcaster's secret.

    Attributes
    ----------
    name : str
    secret : bytes
        32 bytes, from which all else follows.
    """

    name: str
    secret: bytes

    @property
    def public_key(self) -> bytes:
        """The Ed25519 key that receivers know."""
        return bytes(self._private().public_key().public_bytes_raw())

    @property
    def channel(self) -> bytes:
        """As that of the announcement."""
        return hashlib.sha256(self.public_key).digest()[:8]

    def keys(self, period: int, width: int) -> list[bytes]:
        """Return the keys of a period, first block first."""
        return keys_of(self._part(b"chains"), self.channel, period, LAYOUTS[width])

    def announce(
        self, begin_s: float, days: int, progress: Callable[[int, int], None] = lambda *_: None
    ) -> Announcement:
        """Return what receivers need for some days from a time on.

        Parameters
        ----------
        begin_s : float
            Seconds since 1970 (UTC).
        days : int
            At least 1.
        progress : callable
            Called with the number of periods done and of all.
        """
        first = int(number_at(begin_s)) // PERIOD
        count = int(days * 86400 / (PERIOD * SUPERFRAME_S)) + 2
        if days < 1 or not 0 <= first <= first + count < _MOST_PERIODS:
            raise CueError(f"{days} days from {begin_s:.0f} s on: not within 30 years from 2026")
        ends: dict[int, list[bytes]] = {width: [] for width in LAYOUTS}
        for done, period in enumerate(range(first, first + count), start=1):
            for width, found in ends.items():
                found.append(Chain(self.channel, period, width).before(self.keys(period, width)[0]))
            progress(done, count)
        joined = {width: b"".join(found) for width, found in ends.items()}
        bare = Announcement(self.name, self.public_key, first, joined, b"")
        return Announcement(
            self.name, self.public_key, first, joined, self._private().sign(_signed(bare))
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the secret file, for its owner only; it does not replace another one.

        Raises
        ------
        CueError
            If the file exists, or cannot be written.
        """
        document = {"format": _FORMAT, "kind": "secret", "name": self.name}
        text = json.dumps(document | {"secret": _text(self.secret)}, indent=1) + "\n"
        try:
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        except OSError as error:
            raise CueError(f"{path}: cannot write: {error.strerror}") from error
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)

    def _part(self, purpose: bytes) -> bytes:
        return hashlib.sha256(b"cuecast-secret-1 " + purpose + b" " + self.secret).digest()

    def _private(self) -> Any:
        try:
            from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
        except ImportError:
            raise CueError("keys need the package cryptography") from None
        return Ed25519PrivateKey.from_private_bytes(self._part(b"ed25519"))


def new_key(name: str) -> SigningKey:
    """Return a new key, from the system's randomness."""
    return SigningKey(_checked_name(name), secrets.token_bytes(32))


def load_signing_key(path: str | os.PathLike[str]) -> SigningKey:
    """Read a secret file.

    Raises
    ------
    CueError
        If it is missing, damaged, or no secret key.
    """
    document = _load(path, "secret")
    try:
        key = SigningKey(_checked_name(document["name"]), _bytes(document["secret"]))
    except (KeyError, TypeError, ValueError) as error:
        raise CueError(f"{path}: not a secret key of cuecast: {error}") from error
    if len(key.secret) != 32:
        raise CueError(f"{path}: a secret of {len(key.secret)} bytes, not 32")
    return key


def load_announcement(path: str | os.PathLike[str]) -> Announcement:
    """Read a public file and check its signature.

    Raises
    ------
    CueError
        If it is missing, damaged, no public key, or not signed by the key that it names.
    """
    document = _load(path, "public")
    try:
        found = Announcement(
            _checked_name(document["name"]), _bytes(document["public_key"]),
            int(document["first_period"]),
            {width: _bytes(document["ends"][str(width)]) for width in LAYOUTS},
            _bytes(document["signature"]),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise CueError(f"{path}: not a public key of cuecast: {error}") from error
    _check(found, path)
    return found


def _check(found: Announcement, path: str | os.PathLike[str]) -> None:
    try:
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
    except ImportError:
        raise CueError("keys need the package cryptography") from None
    sizes = {len(ends) for ends in found.ends.values()}
    if len(sizes) != 1 or max(sizes) % KEY_BYTES or not 0 <= found.first_period < _MOST_PERIODS:
        raise CueError(f"{path}: not a public key of cuecast: its chains do not fit")
    try:
        Ed25519PublicKey.from_public_bytes(found.public_key).verify(found.signature, _signed(found))
    except (InvalidSignature, ValueError) as error:
        raise CueError(f"{path}: the signature is not that of the key in it") from error


def _document(announcement: Announcement) -> dict[str, Any]:
    return {
        "format": _FORMAT, "kind": "public", "name": announcement.name,
        "public_key": _text(announcement.public_key), "first_period": announcement.first_period,
        "ends": {str(width): _text(ends) for width, ends in announcement.ends.items()},
    }  # fmt: skip


def _signed(announcement: Announcement) -> bytes:
    """Return the bytes that are signed: the document without its signature, in one spelling."""
    return json.dumps(_document(announcement), sort_keys=True, separators=(",", ":")).encode()


def _save(path: str | os.PathLike[str], document: dict[str, Any]) -> None:
    from codec.files.whole import whole_file

    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


def _load(path: str | os.PathLike[str], kind: str) -> dict[str, Any]:
    try:
        with Path(path).open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise CueError(f"{path}: {error.strerror}") from error
    try:
        if len(data) > _MOST_BYTES:
            raise ValueError(f"more than {_MOST_BYTES} bytes")
        document = json.loads(data)
        if document["format"] != _FORMAT or document["kind"] != kind:
            raise ValueError(f"a {document['kind']} of {document['format']}")
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise CueError(f"{path}: not a {kind} key of cuecast: {error}") from error
    return dict(document)


def _checked_name(name: object) -> str:
    if not isinstance(name, str) or not name.isprintable() or not 0 < len(name) <= _LONGEST_NAME:
        raise CueError(f"{name!r} is no name of up to {_LONGEST_NAME} letters")
    return name


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _bytes(text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, TypeError) as error:
        raise ValueError(f"no base64: {error}") from error
