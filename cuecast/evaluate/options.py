"""Options of every kind of evaluation."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class EvaluateOptions:
    """Material and places of an evaluation.

    Attributes
    ----------
    clips : Path or None
        Folder of clips; None means the built-in material.
    channels : tuple of str or None
        Names of channels to go through; None means the usual ones.
    seed : int
        Of everything random.
    folder : Path
        For files on the way; removed afterwards.
    say : callable
        Called with progress, line by line.
    out : Path or None
        Where the results go: a kind may write further tables and pictures there.
    cuers : tuple of str or None
        Virtual cuers, for kinds that measure one: ``identity``, ``identity/law`` or ``all``; None
        means the usual one.
    jobs : int
        Processes at work, where a kind has parts that are independent.
    voice : str
        Name or file of the voice, for kinds that code with one.
    after_s : float
        Seconds of unmarked sound before the mark, for the kind `audio`.
    """

    clips: Path | None
    channels: tuple[str, ...] | None
    seed: int
    folder: Path
    say: Callable[[str], None]
    out: Path | None = None
    cuers: tuple[str, ...] | None = None
    jobs: int = 1
    voice: str = "claire"
    after_s: float = 0.0


def whole_channels(parts: Iterable[str], known: Collection[str]) -> list[str]:
    """Join the names of channels that were split at commas between the coders they name.

    Parameters
    ----------
    parts : iterable of str
        Pieces between commas.
    known : collection of str
        Names of channels, with which each whole name ends.

    Examples
    --------
    >>> whole_channels(["none", "standard+h264:2000k", "hqdn3d+h264:2000k:none"], {"none"})
    ['none', 'standard+h264:2000k,hqdn3d+h264:2000k:none']
    """
    names: list[str] = []
    begun = False
    for part in parts:
        if begun:
            names[-1] += f",{part}"
        else:
            names.append(part)
        profile, _, channel = names[-1].rpartition(":")
        begun = "+" in (profile or channel) and channel not in known
    return names
