"""Fixed files as the page's server sends them: compressed, once while they are unchanged."""

import gzip
import hashlib
from dataclasses import dataclass

from aiohttp import web


@dataclass(frozen=True, slots=True)
class Captions:
    """The text of a programme.

    Attributes
    ----------
    data : bytes
        A WebVTT file, times on the programme's clock.
    language : str
        Its code of BCP 47.
    """

    data: bytes
    language: str


class PackedFile:
    """A file in memory, compressed once.

    Parameters
    ----------
    data : bytes
    kind : str
        Media type, with the character set of text.

    Attributes
    ----------
    size : int
        Bytes on the way to a browser that takes gzip.
    """

    def __init__(self, data: bytes, kind: str) -> None:
        self._kind = kind
        self._packed = gzip.compress(data, mtime=0)
        self._tag = f'"{hashlib.sha256(data).hexdigest()[:24]}"'
        self.size = len(self._packed)

    def response(self, request: web.Request) -> web.Response:
        """Answer a request: 304 if the browser has the file, gzip if it takes that."""
        headers = {"ETag": self._tag, "Vary": "Accept-Encoding"}
        if self._tag in request.headers.get("If-None-Match", ""):
            return web.Response(status=304, headers=headers)
        headers["Content-Type"] = self._kind
        if "gzip" not in request.headers.get("Accept-Encoding", ""):
            return web.Response(body=gzip.decompress(self._packed), headers=headers)
        headers["Content-Encoding"] = "gzip"
        return web.Response(body=self._packed, headers=headers)
