r"""The text of a programme as WebVTT, which browsers time and show.

Examples
--------
>>> from synth.language.subtitles import Subtitle
>>> print(webvtt([Subtitle(1.0, 2.5, "Bonjour\n<Anne>")]).decode())
WEBVTT
<BLANKLINE>
00:00:01.000 --> 00:00:02.500
Bonjour
&lt;Anne&gt;
<BLANKLINE>
"""

import html
import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from codec.errors import CueError
from cuecast.media.subtitles import choose_track, player_s_of, read_track, text_tracks
from receiver.television.packed import Captions
from synth.language.subtitles import Subtitle, read_subtitles
from synth.language.subtitles.read import Terms

_ALL = Terms(everything=True)
"""A viewer reads everything: other languages, credits, sounds."""

_SHORT = {"fra": "fr", "fre": "fr", "eng": "en", "deu": "de", "ger": "de", "spa": "es", "ita": "it"}
"""Codes of two letters, which browsers expect, of the commonest of three."""


def captions_of(
    programme: str | os.PathLike[str], subtitles: str | Path | None = None
) -> Captions | None:
    """Return the captions of a programme: of a file, or of its own tracks of text.

    Parameters
    ----------
    programme : path
    subtitles : path, optional
        A file that stands in for the tracks.

    Returns
    -------
    Captions or None
        None where the programme has no track of text that can be read.

    Raises
    ------
    CueError
        If the file named is not one of subtitles.
    """
    if subtitles is not None:
        return Captions(webvtt(read_subtitles(subtitles, terms=_ALL)), "fr")
    tracks = [track for track in text_tracks(programme) if track.readable]
    if not tracks:
        return None
    try:
        track = choose_track(tracks, None, os.fspath(programme))
    except CueError:  # no French one: any text is better than none
        track = tracks[0]
    try:
        found = read_track(programme, track, terms=_ALL)
    except CueError:  # an empty or damaged track does not keep the programme off
        return None
    later_s = player_s_of(programme)
    found = [
        replace(one, start_s=one.start_s + later_s, end_s=one.end_s + later_s) for one in found
    ]
    return Captions(webvtt(found), _SHORT.get(track.language, track.language) or "fr")


def webvtt(subtitles: Iterable[Subtitle]) -> bytes:
    """Return subtitles as a WebVTT file, with the colours of speakers."""
    blocks = [
        f"{_clock(one.start_s)} --> {_clock(one.end_s)}\n{_marked(one)}\n" for one in subtitles
    ]
    return "\n".join(["WEBVTT\n", *blocks]).encode()


def _clock(time_s: float) -> str:
    milliseconds = round(1000 * time_s)
    minutes, rest = divmod(milliseconds, 60_000)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{rest // 1000:02d}.{rest % 1000:03d}"


def _marked(subtitle: Subtitle) -> str:
    """Return the text with its colours as classes; a blank line would end the cue."""
    runs = subtitle.runs if any(run.colour for run in subtitle.runs) else ()
    text = "".join(
        f"<c.{run.colour}>{html.escape(run.text, quote=False)}</c>"
        if run.colour
        else html.escape(run.text, quote=False)
        for run in runs
    ) or html.escape(subtitle.text, quote=False)
    return "\n".join(line for line in text.split("\n") if line.strip()) or " "
