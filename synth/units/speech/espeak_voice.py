"""A spoken French voice with known phone times: espeak-ng called synchronously.

In: text, or phones. Out: samples at 22 050 Hz and the times at which its phones begin. The
library is the separate run-time part that `synth.language.text.espeak` loads. Its rendering is the
reference of the aligner and the sound of demonstrations; its own timing is not natural enough
to learn durations from.
"""

import _ctypes
import contextlib
import ctypes
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.cues.phonology import PAUSE
from codec.cues.score import Phone
from codec.errors import CueError
from synth.language.text.espeak import RATE_HZ, load

_RATE_PARAMETER = 1
"""Number of the parameter in espeak-ng's interface (speak_lib.h)."""

_POSITION_CHARACTER = 1
"""Positions count characters (speak_lib.h)."""

_TEXT_UTF8, _TEXT_PHONEMES = 0x0001, 0x0100
"""Forms of text (speak_lib.h)."""

_EVENT_END, _EVENT_PHONEME = 0, 7
"""Kinds of events (speak_lib.h)."""

WORDS_PER_MINUTE = range(80, 451)

MNEMONIC = {
    "a": "a", "ɑ": "a", "o": "o", "œ": "W", "ə": "@", "i": "i", "ɔ̃": "O~", "ɑ̃": "A~", "ɛ": "E",
    "ɔ": "O", "u": "u", "ɛ̃": "E~", "ø": "Y", "e": "e", "y": "y", "œ̃": "W~",
    "p": "p", "d": "d", "ʒ": "Z", "k": "k", "v": "v", "z": "z", "s": "s", "ʁ": "r", "b": "b",
    "n": "n", "ɥ": "y", "m": "m", "t": "t", "f": "f", "l": "l", "ʃ": "S", "ɲ": "n^", "w": "w",
    "g": "g", "j": "j", "ŋ": "N", PAUSE: "_:",
}  # fmt: skip
"""Phones in the library's own notation; it has neither ɑ nor ɥ."""


class _Id(ctypes.Union):
    _fields_ = (("number", ctypes.c_int), ("name", ctypes.c_char_p), ("string", ctypes.c_char * 8))


class _Event(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_int),
        ("unique_identifier", ctypes.c_uint),
        ("text_position", ctypes.c_int),
        ("length", ctypes.c_int),
        ("audio_position", ctypes.c_int),
        ("sample", ctypes.c_int),
        ("user_data", ctypes.c_void_p),
        ("id", _Id),
    )


_Callback = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.POINTER(ctypes.c_short), ctypes.c_int, ctypes.POINTER(_Event)
)


LONGEST_LINE = 150
"""Phones that the library takes in one call without losing its place."""


@dataclass(frozen=True, slots=True)
class Rendering:
    """Phones and how they sound.

    Attributes
    ----------
    samples : ndarray of float32, shape (n,)
        Full scale 1, at `RATE_HZ`.
    phones : tuple of Phone
        With their exact times in `samples`; pauses are gaps.
    """

    samples: NDArray[np.float32]
    phones: tuple[Phone, ...]


def speak(text: str, *, words_per_minute: int = 150) -> tuple[NDArray[np.float32], int]:
    """Return French speech of `text`.

    Parameters
    ----------
    text : str
        Written French.
    words_per_minute : int
        80 to 450.

    Returns
    -------
    samples : ndarray of float32, shape (n,)
        Mono, full scale 1; the same text gives the same samples.
    rate : int
        22 050 Hz.

    Raises
    ------
    CueError
        If the rate is out of range or the library fails.

    Examples
    --------
    >>> samples, rate = speak("Bonjour.")
    >>> rate, 0.3 < len(samples) / rate < 1.5
    (22050, True)
    """
    return _render(text.encode(), _TEXT_UTF8, words_per_minute)[0], RATE_HZ


def render(phones: Sequence[str], *, words_per_minute: int = 150) -> Rendering:
    """Speak phones and return the times of each.

    Parameters
    ----------
    phones : sequence of str
        IPA symbols of `codec.cues.phonology`, `PAUSE` for a pause.
    words_per_minute : int
        80 to 450.

    Raises
    ------
    CueError
        If a symbol is unknown, more than `LONGEST_LINE` phones come without a pause, the rate
        is out of range or the library fails.

    Examples
    --------
    >>> rendering = render(["b", "ɔ̃", "ʒ", "u", "ʁ"])
    >>> [phone.symbol for phone in rendering.phones]
    ['b', 'ɔ̃', 'ʒ', 'u', 'ʁ']
    """
    blocks: list[NDArray[np.float32]] = []
    timed: list[Phone] = []
    offset = 0
    for line in _lines(phones):
        samples, starts = _render(_mnemonics(line), _TEXT_UTF8 | _TEXT_PHONEMES, words_per_minute)
        if len(starts) <= len(line):
            raise CueError(f"espeak-ng spoke {len(starts)} of {len(line)} phones")
        bounds = [offset + start for start in (*starts[: len(line)], starts[len(line)])]
        timed += [
            Phone(symbol, a / RATE_HZ, b / RATE_HZ)
            for symbol, (a, b) in zip(line, pairwise(bounds), strict=True)
            if symbol != PAUSE
        ]
        blocks.append(samples)
        offset += len(samples)
    return Rendering(np.concatenate(blocks or [np.zeros(0, np.float32)]), tuple(timed))


def _lines(phones: Sequence[str]) -> Iterator[list[str]]:
    """Yield the phones in lines that end in a pause."""
    line: list[str] = []
    for symbol in phones:
        if symbol not in MNEMONIC:
            raise CueError(f"unknown phone {symbol!r}")
        if symbol != PAUSE:
            line.append(symbol)
        elif line:
            yield [*line, PAUSE]
            line = []
        if len(line) > LONGEST_LINE:
            raise CueError(f"{len(line)} phones without a pause, more than {LONGEST_LINE}")
    if line:
        yield [*line, PAUSE]


def _mnemonics(line: Sequence[str]) -> bytes:
    return f"[[{' '.join(MNEMONIC[symbol] for symbol in line)}]]".encode()


@contextlib.contextmanager
def _fresh_library() -> Iterator[ctypes.CDLL]:
    """Load a private copy of the library for one rendering.

    The library keeps the phase of its voice's flutter from one call to the next and cannot be
    made to forget it: only a copy that has never spoken gives the same samples every time.
    """
    import espeakng_loader

    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "espeak-ng"
        shutil.copyfile(espeakng_loader.get_library_path(), copy)
        loaded = load(str(copy))
        try:
            yield loaded
        finally:
            loaded.espeak_Terminate()
            _ctypes.dlclose(loaded._handle)


def _render(
    text: bytes, flags: int, words_per_minute: int
) -> tuple[NDArray[np.float32], list[int]]:
    """Return the samples and the first sample of each phone and pause."""
    if words_per_minute not in WORDS_PER_MINUTE:
        raise CueError(f"words_per_minute is {words_per_minute}, not within 80..450")
    blocks: list[bytes] = []
    starts: list[int] = []

    def collect(wav: object, n: int, events: object) -> int:
        if n > 0:
            blocks.append(ctypes.string_at(wav, 2 * n))  # type: ignore[arg-type]
        position = 0
        # Event list of the block, ended by an event of type 0.
        while (event := events[position]).type != _EVENT_END:  # type: ignore[index]
            if event.type == _EVENT_PHONEME:
                starts.append(event.sample)
            position += 1
        return 0

    callback = _Callback(collect)
    with _fresh_library() as loaded:
        loaded.espeak_SetSynthCallback(callback)
        loaded.espeak_SetParameter(_RATE_PARAMETER, words_per_minute, 0)
        status = loaded.espeak_Synth(
            text, ctypes.c_size_t(len(text) + 1), 0, _POSITION_CHARACTER, 0, flags, None, None
        )
    if status != 0:
        raise CueError(f"espeak-ng refuses to speak: status {status}")
    samples = np.frombuffer(b"".join(blocks), dtype="<i2").astype(np.float32) / np.float32(32768)
    return samples, starts
