"""A new speaker's voice from her corpora: a folder with voice, units and a report."""

import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from codec.cuer.voice import save_voice
from codec.errors import CueError
from codec.superframe.coding import keep_coding
from codec.training.coding_tables import train_coding
from synth.units.recordings.archive import write_archive
from synth.voices.learn import learn_speaker
from synth.voices.takes import read_corpora

UNITS = "units"
"""Folder of the recorded units within that of the voice."""


def build_from_corpora(
    source: str,
    target: str,
    *,
    mapping: Mapping[str, str] | None = None,
    progress: Callable[[int, int], None],
) -> dict[str, Any]:
    """Write the voice of a folder of takes and keep its coding tables; return a report.

    Parameters
    ----------
    source : str
        Folder of C3D files with TextGrids, and sounds if there are any.
    target : str
        New folder; its name is the voice's. It appears when everything is done.
    mapping : mapping of str to str, optional
        From the files' labels to our markers.
    progress : callable

    Raises
    ------
    CueError
        If the takes do not make a voice, or `target` exists.
    """
    folder = Path(target)
    if folder.exists():
        raise CueError(f"{target} exists already")
    name = folder.name
    takes = read_corpora(Path(source), mapping=mapping)
    learnt = learn_speaker(Path(source), name, takes=takes, progress=progress)
    rates = {recording.fs for recording in learnt.recordings}
    if len(rates) > 1:
        raise CueError(f"{source}: its sounds differ in their rates: {sorted(rates)} Hz")
    coding = train_coding(learnt.voice, learnt.motions)
    folder.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{name}."))
    try:
        save_voice(learnt.voice, work / f"{name}.npz")
        if learnt.recordings:
            write_archive(work / UNITS, learnt.recordings)
        work.chmod(0o755)
        work.rename(folder)
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        raise
    keep_coding(coding)
    return {
        "voice": str(folder / f"{name}.npz"),
        "identity": learnt.voice.identity,
        "coding": coding.identity,
        "takes": len(takes),
        "left_out": list(learnt.left_out),
        "minutes": round(sum(take.duration_s for take in takes) / 60, 2),
        "residual_mm": learnt.residual_mm,
        "borrowed_sounds": learnt.borrowed,
        "recordings": len(learnt.recordings),
    }
