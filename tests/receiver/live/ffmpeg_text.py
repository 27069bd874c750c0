"""FFmpeg's own writer of DVB subtitles, called through the libraries that PyAV brings.

PyAV encodes subtitles of text only; pictures need the C function. Structures follow
`libavcodec/avcodec.h` of FFmpeg 6 to 8.
"""

import ctypes
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

Part = tuple[int, int, NDArray[np.uint8], NDArray[np.uint32]]
"""Left and top edge, indices (height, width), colours (n) as opacity, red, green, blue."""

_MOST_BYTES = 1 << 20
_BITMAP = 1
_SIZE, _TIME_BASE = b"720x576", b"1/1000"


class _Rect(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("x", "y", "w", "h", "nb_colors")),
        ("data", ctypes.c_void_p * 4),
        ("linesize", ctypes.c_int * 4),
        ("flags", ctypes.c_int),
        ("type", ctypes.c_int),
        ("text", ctypes.c_char_p),
        ("ass", ctypes.c_char_p),
    )


class _Subtitle(ctypes.Structure):
    _fields_ = (
        ("format", ctypes.c_uint16),
        ("start", ctypes.c_uint32),
        ("end", ctypes.c_uint32),
        ("num_rects", ctypes.c_uint),
        ("rects", ctypes.POINTER(ctypes.POINTER(_Rect))),
        ("pts", ctypes.c_int64),
    )


def _library(name: str) -> ctypes.CDLL:
    found = sorted((Path(av.__file__).parent.parent / "av.libs").glob(f"lib{name}-*"))
    if not found:
        pytest.skip("PyAV has no libraries of its own here: FFmpeg's writer cannot be called")
    return ctypes.CDLL(str(found[0]))


class FfmpegText:
    """Writes pages of pictures as the segments of DVB subtitles."""

    def __init__(self) -> None:
        util, self._codecs = _library("avutil"), _library("avcodec")
        for function in ("avcodec_find_encoder_by_name", "avcodec_alloc_context3"):
            getattr(self._codecs, function).restype = ctypes.c_void_p
        codec = ctypes.c_void_p(self._codecs.avcodec_find_encoder_by_name(b"dvbsub"))
        self._context = ctypes.c_void_p(self._codecs.avcodec_alloc_context3(codec))
        for name, value in ((b"video_size", _SIZE), (b"time_base", _TIME_BASE)):
            assert util.av_opt_set(self._context, name, value, 0) == 0
        assert self._codecs.avcodec_open2(self._context, codec, None) == 0

    def page(self, parts: list[Part]) -> bytes:
        """Return a page of several regions; none clear it. Up to 16 colours take 4 bits."""
        kept, rects = [], []
        for x, y, indices, colours in parts:
            indices = np.ascontiguousarray(indices)
            palette = np.zeros(256, np.uint32)
            palette[: len(colours)] = colours
            rect = _Rect(x, y, indices.shape[1], indices.shape[0], len(colours))
            rect.data[0], rect.data[1] = indices.ctypes.data, palette.ctypes.data
            rect.linesize[0], rect.type = indices.shape[1], _BITMAP
            kept += [indices, palette]
            rects.append(ctypes.pointer(rect))
        listed = (ctypes.POINTER(_Rect) * max(1, len(rects)))(*rects)
        subtitle = _Subtitle(0, 0, 5000, len(rects), listed if rects else None, 0)
        out = ctypes.create_string_buffer(_MOST_BYTES)
        size = self._codecs.avcodec_encode_subtitle(
            self._context, out, _MOST_BYTES, ctypes.byref(subtitle)
        )
        assert size > 0
        return out.raw[:size]
