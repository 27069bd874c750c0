"""Capturing: a file goes in, a motion of a voice and a report come out."""

import os
from pathlib import Path

import numpy as np

from codec.cuer.models.threads import one_thread
from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.options import DEFAULTS, Captured, CaptureOptions
from synth.capture.points.markers import capture_markers
from synth.capture.sources.sniff import kind_of
from synth.capture.tracker.landmarks import capture_landmarks
from synth.capture.tracker.livelink import capture_live_link


@one_thread
def capture_motion(
    path: str | os.PathLike[str], voice: Voice, options: CaptureOptions = DEFAULTS
) -> Captured:
    """Return the motion that a recording shows.

    Parameters
    ----------
    path : path-like
        Any of the kinds of `synth.capture.sources.sniff.KINDS`.
    voice : Voice
        Whose parameters are wanted.
    options : CaptureOptions

    Returns
    -------
    Captured

    Raises
    ------
    CueError
        If the file is missing, malformed, or shows too little of the cuer.

    Examples
    --------
    A motion's own markers, written as C3D and captured again:

    >>> import tempfile
    >>> from codec import load_voice
    >>> from codec.cuer.c3d import write_c3d
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> motion = motion_of(score_of_text("Oui"), voice)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_c3d(f"{folder}/take.c3d", voice.reconstruct(motion.params), rate_hz=50.0)
    ...     captured = capture_motion(f"{folder}/take.c3d", voice, CaptureOptions(keys=False))
    >>> captured.motion.params.shape == motion.params.shape
    True
    """
    source, kind = Path(path), kind_of(path)
    try:
        return _capture(source, kind, voice, options)
    except np.linalg.LinAlgError as error:
        raise CueError(f"{path}: its points fit no body: {error}") from error


def _capture(source: Path, kind: str, voice: Voice, options: CaptureOptions) -> Captured:
    """Read a source of a kind that is known."""
    if kind == "livelink":
        return capture_live_link(source, voice, options)
    if kind == "landmarks":
        return capture_landmarks(source, voice, options)
    if kind == "video":
        from synth.capture.tracker.video import capture_video

        return capture_video(source, voice, options)
    return capture_markers(source, kind, voice, options)
