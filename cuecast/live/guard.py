"""Who may send live text: origin, host and token of a request, and how many captions a minute.

A page that is open on the sender's machine can reach a server on 127.0.0.1, and a name of that
page can be made to point there (DNS rebinding). Browsers state the page in ``Origin`` and the
name in ``Host``; both are checked (RFC 6455, section 10.2). Programs elsewhere bring a token
(RFC 6750).
"""

import hmac
import ipaddress
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from codec.errors import CueError

CAPTIONS_PER_S, CAPTIONS_AT_ONCE = 5.0, 40
"""Captions accepted per second in the long run, and at once: a respeaker sends one or two a second,
a file of subtitles played at its own pace one."""

_SHORTEST_TOKEN = 16
"""Characters that a token needs at least: with fewer it could be guessed over a network."""

_LONGEST_TOKEN = 1024
"""Characters at most: header fields of HTTP servers end at 8 KiB."""


@dataclass(frozen=True, slots=True)
class Guard:
    """Rules for requests that may change the output on air.

    Attributes
    ----------
    host : str
        Address of the server.
    token : str
        Expected bearer token; empty: none is asked for.
    origins : tuple of str
        Origins of web pages that may send live text.
    """

    host: str = "127.0.0.1"
    token: str = ""
    origins: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.token and not _is_loopback(self.host):
            raise CueError(
                f"--host {self.host}: other machines can reach this address, so that live text "
                "needs --token-file"
            )

    def objection(self, headers: Mapping[str, str]) -> str | None:
        """Return why a request is refused, None if it is allowed.

        Parameters
        ----------
        headers : mapping
            Header fields of the request, names in any case.

        Examples
        --------
        >>> Guard().objection({"Host": "127.0.0.1:9100"})
        >>> Guard().objection({"Host": "127.0.0.1:9100", "Origin": "https://evil.example"})
        'origin https://evil.example is not allowed (--allow-origin)'
        """
        origin = headers.get("Origin")
        if origin is not None and origin not in self.origins:
            return f"origin {origin[:100]} is not allowed (--allow-origin)"
        if self.token:
            scheme, _, token = headers.get("Authorization", "").partition(" ")
            if scheme.lower() != "bearer" or not hmac.compare_digest(
                token.strip().encode(), self.token.encode()
            ):
                return "the token is missing or wrong (Authorization: Bearer TOKEN)"
            return None
        name = _host_name(headers.get("Host", ""))
        if name != "localhost" and not _is_loopback(name):
            return f"host {name[:100]!r} is not this machine's own name"
        return None


def read_token(path: str) -> str:
    """Read a token from a file; white space around it does not count.

    Raises
    ------
    CueError
        If the file cannot be read, or holds no token of a safe length.
    """
    try:
        token = Path(path).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise CueError(f"{path}: the token cannot be read: {error}") from error
    if not _SHORTEST_TOKEN <= len(token) <= _LONGEST_TOKEN or not token.isprintable():
        raise CueError(
            f"{path}: a token has {_SHORTEST_TOKEN} to {_LONGEST_TOKEN} printable characters, "
            f"this one {len(token)}"
        )
    return token


class RateLimit:
    """Token bucket: a long-term rate and a burst (ITU-T I.371 names it leaky bucket).

    Parameters
    ----------
    per_s : float
        Events per second in the long run.
    burst : int
        Events that may come at once.
    clock : callable
        Returns seconds that never run backwards.

    Examples
    --------
    >>> limit = RateLimit(1.0, 2, lambda: 0.0)
    >>> [limit.allows() for _ in range(3)]
    [True, True, False]
    """

    def __init__(self, per_s: float, burst: int, clock: Callable[[], float]) -> None:
        self._per_s, self._burst, self._clock = per_s, burst, clock
        self._left, self._at_s = float(burst), clock()

    def allows(self) -> bool:
        """Count one event; return whether it is within the limit."""
        now_s = self._clock()
        self._left = min(self._burst, self._left + (now_s - self._at_s) * self._per_s)
        self._at_s = now_s
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _host_name(field: str) -> str:
    """Return the name or address in a ``Host`` field, without its port."""
    try:
        return urlsplit(f"//{field}").hostname or ""
    except ValueError:
        return ""
