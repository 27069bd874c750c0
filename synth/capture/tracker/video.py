"""A film of an interpreter, through an image tracker in another environment.

Frames are decoded here and sent to `synth.capture.tracker.mediapipe_child`, which the tracker's
interpreter runs; its landmarks go the way of all landmarks. Which interpreter that is says
``--tracker``, the variable ``CUECAST_TRACKER``, or the running one has MediaPipe itself.
"""

import importlib.util
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import av
import numpy as np
from numpy.typing import NDArray

from codec.cuer.voice import Voice
from codec.errors import CueError
from synth.capture.options import Captured, CaptureOptions
from synth.capture.tracker.landmarks import capture_landmarks

TRACKER_VARIABLE = "CUECAST_TRACKER"
HOW_TO = (
    "a video needs an image tracker: make an environment (Python 3.9 to 3.12) with "
    "'pip install mediapipe==0.10.21' (990 MB on disk, about 8 minutes) and name its python by "
    f"--tracker or {TRACKER_VARIABLE}; or capture the landmark CSV of any other tracker"
)

_LONGEST_SIDE = 960
"""Longest side in pixels of the pictures that the tracker gets."""

_CHILD = Path(__file__).with_name("mediapipe_child.py")

_LAST_WORDS = 400
"""Characters of the tracker's last line that a message quotes."""


def capture_video(path: Path, voice: Voice, options: CaptureOptions) -> Captured:
    """Return the motion that a film shows; time 0 is its first frame.

    Raises
    ------
    CueError
        If there is no tracker, the file is no film, the tracker fails or sees nobody.
    """
    interpreter = find_tracker(options.tracker)
    if interpreter is None:
        raise CueError(f"{path}: {HOW_TO}")
    with tempfile.TemporaryDirectory(prefix="cuecast-") as folder:
        table = Path(folder) / path.with_suffix(".csv").name
        aspect = track(path, interpreter, table)
        captured = capture_landmarks(table, voice, replace(options, aspect=aspect))
    captured.report["input"] |= {"file": path.name, "kind": "video"}
    return captured


def find_tracker(given: str | None) -> str | None:
    """Return the interpreter that has the tracker, or None if there is none."""
    chosen = given or os.environ.get(TRACKER_VARIABLE)
    if chosen:
        return chosen
    return sys.executable if importlib.util.find_spec("mediapipe") else None


def track(path: Path, interpreter: str, table: Path) -> float:
    """Write the landmarks of a film to `table`; return its picture's width over its height.

    Raises
    ------
    CueError
        If the film cannot be read, or the tracker does not run.
    """
    frames = _frames(path)
    first = next(frames, None)
    if first is None:
        raise CueError(f"{path}: no picture in this file")
    height, width, _ = first[1].shape
    with table.open("wb") as rows:
        try:
            child = subprocess.Popen(
                [interpreter, "-I", str(_CHILD)],
                stdin=subprocess.PIPE,
                stdout=rows,
                stderr=subprocess.PIPE,
            )
        except OSError as error:
            raise CueError(f"tracker {interpreter}: {error.strerror}") from error
        words: list[bytes] = []
        assert child.stdin is not None
        assert child.stderr is not None
        listener = threading.Thread(target=_listen, args=(child.stderr, words))
        listener.start()
        try:
            _send(child.stdin, width, height, first, frames)
        except BrokenPipeError:
            pass  # it has ended: its status says why
        except BaseException:
            child.kill()
            raise
        finally:
            status = child.wait()
            listener.join()
            child.stderr.close()
    if status != 0:
        said = b"".join(words).decode(errors="replace").strip().splitlines()
        last = said[-1][-_LAST_WORDS:] if said else "it said nothing"
        raise CueError(f"tracker {interpreter} ended with status {status}: {last}")
    return float(width / height)


def _listen(pipe: IO[bytes], words: list[bytes]) -> None:
    """Keep a tracker's last output, so that it never waits for us to read."""
    for line in pipe:
        words.append(line)
        del words[:-20]


def _send(
    pipe: IO[bytes],
    width: int,
    height: int,
    first: tuple[float, NDArray[np.uint8]],
    rest: Iterator[tuple[float, NDArray[np.uint8]]],
) -> None:
    with pipe:
        pipe.write(f"{width} {height}\n".encode())
        time_s, picture = first
        begin_s = time_s
        while True:
            pipe.write(f"{time_s - begin_s:.6f}\n".encode())
            pipe.write(picture.tobytes())
            following = next(rest, None)
            if following is None:
                return
            time_s, picture = following


def _frames(path: Path) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Yield time in seconds and picture (height, width, 3) of each frame, square pixels.

    Large pictures are made smaller: trackers look at few pixels.
    """
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                return
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            size: tuple[int, int] | None = None
            for frame in container.decode(stream):
                if frame.pts is None:
                    continue
                size = size or _size(frame, stream.sample_aspect_ratio)
                small = frame.reformat(width=size[0], height=size[1], format="rgb24")
                yield float(frame.time or 0.0), np.asarray(small.to_ndarray(), dtype=np.uint8)
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise CueError(f"{path}: cannot be read as a film: {error}") from error


def _size(frame: Any, sample_aspect: Any) -> tuple[int, int]:
    """Return width and height of the pictures that are sent, even and square-pixelled."""
    width = frame.width * float(sample_aspect or 1)
    shrink = min(1.0, _LONGEST_SIDE / max(width, frame.height))
    sides = [max(2, 2 * round(side * shrink / 2)) for side in (width, frame.height)]
    return sides[0], sides[1]
