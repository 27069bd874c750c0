"""The two files of a broadcaster's key: the secret one, and what receivers are given.

The public file holds an Ed25519 key (RFC 8032, by the library `cryptography`), the time for which
it holds, the ends of all chains of that time, and a signature over all of it. A file that continues
an earlier one is signed by the same key, and can come from anywhere. Specification:
spec/authentication.md, section 5.
"""

import base64
import binascii
import hashlib
import json
import os
import secrets
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from codec.authentication.chain import Chain, keys_of
from codec.authentication.layout import KEY_BYTES, LAYOUTS, PERIOD, SUPERFRAME_S, number_at, time_of
from codec.errors import CueError

_FORMATS = {"secret": "cuecast-key-1", "public": "cuecast-key-3"}
"""Formats of the two files; a secret of the first edition serves the second."""

_FIRST_EDITION = (
    "a public key of the first edition, of which proofs can be forged: get the broadcaster's new "
    "one, made by `cuecast key renew`"
)

_MOST_BYTES = 16 << 20
"""Bytes of a key's file at most."""

_MOST_PERIODS = 357
"""Periods that a key may hold for: thirty years."""

_LONGEST_NAME = 80
"""Letters of a channel's name at most."""


@dataclass(frozen=True, slots=True)
class Announcement:
    """The part of a broadcaster's key that receivers trust.

    Attributes
    ----------
    name : str
        As the broadcaster calls himself.
    public_key : bytes
        Ed25519, 32 bytes.
    first, until : int
        Numbers on the public clock between which it holds, `until` excluded.
    ends : dict of int to bytes
        By the width of the proof fields: the end of the chain of each period of that time, 8 bytes
        each.
    signature : bytes
        Ed25519 over all else, 64 bytes.

    Examples
    --------
    >>> key = SigningKey("Chaîne 1", bytes(32))
    >>> announced = key.announce(begin_s=1.79e9, days=1)
    >>> announced.name, len(announced.public_key)
    ('Chaîne 1', 32)
    """

    name: str
    public_key: bytes
    first: int
    until: int
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
        """Periods whose ends are given."""
        return range(self.first // PERIOD, -(-self.until // PERIOD))

    @property
    def dates(self) -> tuple[str, str]:
        """Dates between which it holds."""
        begin, end = (
            datetime.fromtimestamp(time_of(number), UTC).isoformat(timespec="minutes")
            for number in (self.first, self.until)
        )
        return begin, end

    @property
    def span(self) -> str:
        """Dates between which it holds, in words."""
        return "from {} to {}".format(*self.dates)

    def blocks(self, length: int) -> range:
        """Return the blocks of `length` superframes that end in the time for which it holds."""
        return range(self.first // length, -(-self.until // length))

    def end_of(self, period: int, width: int) -> bytes:
        """Return the end of a period's chain."""
        at = (period - self.periods.start) * KEY_BYTES
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
        32 bytes that determine everything else.

    Examples
    --------
    >>> SigningKey("Chaîne 1", bytes(32)).name
    'Chaîne 1'
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

    def keys(self, period: int, width: int) -> tuple[bytes, ...]:
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
        first = int(number_at(begin_s))
        until = first + int(days * 86400 / SUPERFRAME_S)
        if days < 1 or not 0 <= first < until <= _MOST_PERIODS * PERIOD:
            raise CueError(f"{days} days from {begin_s:.0f} s on: not within 30 years from 2026")
        ends = dict.fromkeys(LAYOUTS, b"")
        bare = Announcement(self.name, self.public_key, first, until, ends, b"")
        for done, period in enumerate(bare.periods, start=1):
            for width in LAYOUTS:
                keys = self.keys(period, width)
                ends[width] += Chain(self.channel, period, width).before(keys[0], 0)
            progress(done, len(bare.periods))
        return replace(bare, signature=self._private().sign(_signed(bare)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the secret file, for its owner only; it does not replace another one.

        Raises
        ------
        CueError
            If the file exists, or cannot be written.
        """
        document = {"format": _FORMATS["secret"], "kind": "secret", "name": self.name}
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
            _checked_name(document["name"]),
            _bytes(document["public_key"]),
            int(document["first"]),
            int(document["until"]),
            {width: _bytes(document["ends"][str(width)]) for width in LAYOUTS},
            _bytes(document["signature"]),
        )
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
    last = _MOST_PERIODS * PERIOD
    fits = 0 <= found.first < found.until <= last and sizes == {KEY_BYTES * len(found.periods)}
    if not fits:
        raise CueError(f"{path}: not a public key of cuecast: its chains do not fit")
    try:
        Ed25519PublicKey.from_public_bytes(found.public_key).verify(found.signature, _signed(found))
    except (InvalidSignature, ValueError) as error:
        raise CueError(f"{path}: the signature is not that of the key in it") from error


def _document(announcement: Announcement) -> dict[str, Any]:
    return {
        "format": _FORMATS["public"],
        "kind": "public",
        "name": announcement.name,
        "public_key": _text(announcement.public_key),
        "first": announcement.first,
        "until": announcement.until,
        "ends": {str(width): _text(ends) for width, ends in announcement.ends.items()},
    }


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
        found = document["format"], document["kind"]
        if kind == "public" and found == (_FORMATS["secret"], kind):
            raise CueError(f"{path}: {_FIRST_EDITION}")
        if found != (_FORMATS[kind], kind):
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
