"""Voices for coding: loaded by name or file, with a word if their coding tables are missing."""

from codec.coding import is_trained
from codec.voice import Voice, load_voice
from cuecast.progress import note


def coding_voice(name: str) -> Voice:
    """Return a voice, and tell when the codec has no tables trained for it.

    Raises
    ------
    VoiceError
        If there is no such voice.
    """
    voice = load_voice(name)
    if not is_trained(voice):
        note(
            f"voice {voice.name} has no trained coding tables: derived ones are used, which cost "
            "more bits and have to be the same at both ends "
            "(python -m synth.build_coding trains them)"
        )
    return voice
