"""Pictures of the demonstration: the screen over time, and the keys sent and received."""

from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from codec.motion import Motion
from codec.score import PLACEMENTS, Key
from codec.voice import Voice
from cuecast.files import whole_file
from receiver.render import render_frames

_FRAMES = 6
_KEY_MIDDLE = 0.6
_CUER_WIDTH = 310
_HAND = slice(7, 19)


def draw_strip(path: Path, programme: Path, motion: Motion, voice: Voice) -> None:
    """Write a strip of screens, programme at the left and received cuer at the right of each.

    Parameters
    ----------
    path : Path
        PNG.
    programme : Path
        Film that the viewer sees.
    motion : Motion
        As received, with its score.
    voice : Voice
    """
    keys = motion.score.keys if motion.score else ()
    chosen = [keys[i] for i in np.linspace(1, len(keys) - 2, _FRAMES).round().astype(int)]
    times = np.array([key.start + _KEY_MIDDLE * (key.end - key.start) for key in chosen])
    screens = _pictures_at(programme, times)
    height = screens[0].shape[0]
    cuers = render_frames(motion, voice, times, size=(_CUER_WIDTH, height))
    rows = [
        np.concatenate([screen, cuer], axis=1) for screen, cuer in zip(screens, cuers, strict=True)
    ]
    half = _FRAMES // 2
    columns = [np.concatenate(rows[:half]), np.concatenate(rows[half:])]
    write_png(path, np.concatenate(columns, axis=1))


def draw_keys(path: Path, sent: Motion, received: Motion) -> None:
    """Plot placements of the keys and hand parameters, sent and received, over time.

    Needs matplotlib (extra ``plots``).
    """
    import matplotlib.figure

    figure = matplotlib.figure.Figure(figsize=(12, 6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for motion, level, colour, label in (
        (sent, 0.18, "tab:blue", "sent"), (received, -0.18, "tab:orange", "received"),
    ):  # fmt: skip
        for key in motion.score.keys if motion.score else ():
            _draw_key(above, key, level, colour)
        above.plot([], [], color=colour, linewidth=6, label=label)
        below.plot(
            motion.times_s, motion.params[:, _HAND.start], color=colour, linewidth=1, label=label
        )
    above.set_yticks(range(1, len(PLACEMENTS)), PLACEMENTS[1:])
    above.set_ylabel("placement (number: shape)")
    above.legend(loc="upper left")
    below.set_ylabel(f"parameter {sent.layout[_HAND.start]}")
    below.set_xlabel("programme time, s")
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=100)


def _draw_key(axes: object, key: Key, level: float, colour: str) -> None:
    from matplotlib.axes import Axes

    assert isinstance(axes, Axes)
    row = PLACEMENTS.index(key.placement) + level
    axes.plot([key.start, key.end], [row, row], color=colour, linewidth=6, solid_capstyle="butt")
    axes.text((key.start + key.end) / 2, row, str(key.shape), ha="center", va="center", fontsize=6)


def _pictures_at(programme: Path, times_s: NDArray[np.float64]) -> list[NDArray[np.uint8]]:
    """Return the pictures that a film shows at ascending times, (height, width, 3)."""
    pictures: list[NDArray[np.uint8]] = []
    with av.open(f"file:{programme}", "r") as container:
        for frame in container.decode(video=0):
            while len(pictures) < len(times_s) and (frame.time or 0.0) >= times_s[len(pictures)]:
                pictures.append(frame.to_ndarray(format="rgb24").astype(np.uint8))
    return pictures


def write_png(path: Path, picture: NDArray[np.uint8]) -> None:
    """Write a picture, (height, width, 3) red, green, blue."""
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
    with whole_file(path) as temporary:
        frame.save(temporary)
