"""Voices for coding: loaded by name or file, with a word if their coding tables are missing."""

from collections.abc import Callable

from codec.cuer.voice import Voice, load_voice
from codec.superframe.coding import keep_coding, trained_path
from cuecast.command.progress import note


def coding_voice(name: str) -> Voice:
    """Return a voice, and report it if the codec has no tables trained for it.

    Raises
    ------
    VoiceError
        If there is no such voice.
    """
    voice = load_voice(name)
    if trained_path(voice) is None:
        note(
            f"voice {voice.name} has no trained coding tables: those derived from it are used, "
            "which cost more bits; receivers with trained ones refuse the stream "
            "(cuecast voice build trains them)"
        )
    return voice


def train_voice(voice: Voice, *, progress: Callable[[int, int], None]) -> None:
    """Train the coding tables of a virtual cuer's voice into the user's folder, if there are none.

    Parameters
    ----------
    voice : Voice
    progress : callable
        Called after every step with the work done and the total.

    Raises
    ------
    CueError
        If the voice is no virtual cuer's.
    """
    from codec.training.coding_tables import train_coding
    from synth.studio.recital import examples

    if trained_path(voice) is not None:
        return
    motions = []
    progress(0, _STEPS)
    for motion in examples(voice):
        motions.append(motion)
        progress(len(motions), _STEPS)
    keep_coding(train_coding(voice, motions[:1], motions[1:]))
    progress(_STEPS, _STEPS)


_STEPS = 3
"""Parts of the work that the progress bar counts."""
