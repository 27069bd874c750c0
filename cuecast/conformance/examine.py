"""The whole examination of one decoder."""

import json
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from codec.cuer.voice import load_voice, save_voice
from codec.errors import CueError
from codec.superframe.coding import coding_for, save_coding
from cuecast.conformance.drawing import examine_files, examine_reception
from cuecast.conformance.files import examine_stream_files
from cuecast.conformance.program import Program
from cuecast.conformance.proofs import examine_proofs
from cuecast.conformance.sound import examine_sound
from cuecast.conformance.superframes import examine_superframes
from cuecast.conformance.verdict import CaseVerdict, ConformanceReport
from receiver.export.device_voice import device_voice

PROTOCOL = 1
"""Version of the protocol that a decoder has to state."""

REQUESTS = ("superframe", "draw", "file", "proofs", "sound")
"""Requests that a decoder may offer."""

VECTORS = Path(__file__).parents[2] / "spec" / "vectors"
"""Where a checkout has the vectors."""


def examine(
    command: Sequence[str], vectors: str | os.PathLike[str] | None = None
) -> ConformanceReport:
    """Examine the decoder that a command starts.

    Parameters
    ----------
    command : sequence of str
    vectors : path-like, optional
        Folder of the vectors; the checkout's by default.

    Returns
    -------
    ConformanceReport

    Raises
    ------
    CueError
        If vectors are missing, or the program breaks the protocol.
    """
    folder = VECTORS if vectors is None else Path(vectors)
    documents = {
        name: _read(folder / f"{name}.json")
        for name in ("superframe", "stream", "reception", "authentication", "hearing")
    }
    with Program(command) as program, tempfile.TemporaryDirectory() as files:
        hello = program.ask("hello")
        if hello.get("protocol") != PROTOCOL:
            raise CueError(f"{program.name}: protocol {hello.get('protocol')}, this is {PROTOCOL}")
        does = hello.get("does", [])
        _give_voice(program, Path(files))
        verdicts = list(_examined(program, does, documents))
        if "sound" in does:
            verdicts += examine_sound(program, documents["hearing"], folder, Path(files))
        skipped = tuple(name for name in REQUESTS if name not in does)
    return ConformanceReport(str(hello.get("name", program.name)), tuple(verdicts), skipped)


def _examined(
    program: Program, does: Sequence[str], documents: dict[str, Any]
) -> Iterator[CaseVerdict]:
    if "superframe" in does:
        yield from examine_superframes(program, documents["superframe"])
    if "draw" in does:
        yield from examine_files(program, documents["stream"])
        yield from examine_reception(program, documents["reception"])
    if "file" in does:
        yield from examine_stream_files(program, documents["stream"])
    if "proofs" in does:
        yield from examine_proofs(program, documents["authentication"])


def _give_voice(program: Program, folder: Path) -> None:
    """Offer the built-in voice in each form that a decoder may read."""
    voice = load_voice()
    (folder / "voice.bin").write_bytes(device_voice(voice))
    save_voice(voice, folder / "voice.npz")
    save_coding(coding_for(voice), folder / "coding.npz")
    answer = program.ask(
        "voice",
        binary=str(folder / "voice.bin"),
        voice=str(folder / "voice.npz"),
        coding=str(folder / "coding.npz"),
        identity=coding_for(voice).identity,
    )
    if answer.get("loaded") is not True:
        raise CueError(f"{program.name}: the voice was not loaded: {answer}")


def _read(path: Path) -> dict[str, Any]:
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CueError(
            f"{path}: the vectors are missing; they are in spec/vectors of a checkout (--vectors)"
        ) from error
    return document
