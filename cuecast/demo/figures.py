"""Pictures of the demonstration: the screen over time, and the keys sent and received."""

import textwrap
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

from codec.analysis.phases import hand_speed
from codec.cuer.motion import Motion, sample_params
from codec.cuer.voice import Voice
from codec.cues.score import PLACEMENTS, Key
from codec.files.whole import whole_file
from receiver.drawing.render import draw
from synth.language.subtitles import Subtitle

_MOMENTS = 6
"""Keys that the strip shows."""

_APPROACH_S = 0.06
"""Seconds before a key's start: the search for its stillest moment begins there."""

_LOOK_HZ = 100.0
"""Moments per second among which the stillest is looked for."""

_LINE = 40
"""Characters of a line of subtitles."""

_CUER_WIDTH = 310
"""Width in pixels of the cuer's inset."""

_HAND = slice(7, 19)


def draw_strip(
    path: Path, programme: Path, subtitles: list[Subtitle], motion: Motion, voice: Voice
) -> None:
    """Draw six moments: the television with its cuer, and the markers that she is made of.

    Parameters
    ----------
    path : Path
        PNG.
    programme : Path
        Film that the viewer sees.
    subtitles : list of Subtitle
        Those of the film.
    motion : Motion
        As received, with its score.
    voice : Voice
    """
    import matplotlib.figure

    keys = motion.score.keys if motion.score else ()
    # Her own clock runs ahead and behind: moments without a subtitle would tell less.
    keys = tuple(k for k in keys if any(s.start_s <= k.start < s.end_s for s in subtitles)) or keys
    chosen = [keys[i] for i in np.linspace(1, len(keys) - 2, _MOMENTS).round().astype(int)]
    times = np.array([_stillest(motion, voice, key) for key in chosen])
    screens = _pictures_at(programme, times)
    size = (_CUER_WIDTH, screens[0].shape[0])
    markers = draw(motion, voice, times, size=size)
    figure = matplotlib.figure.Figure(figsize=(16, 10), layout="constrained")
    for axes, key, time_s, screen, points in zip(
        figure.subplots(_MOMENTS // 2, 2).flat, chosen, times, screens, markers, strict=True
    ):
        corner = np.ascontiguousarray(screen[:, -_CUER_WIDTH:])
        (cuer,) = draw(
            motion, voice, np.array([time_s]), style="avatar", size=size, background=corner
        )
        axes.imshow(np.concatenate([screen[:, :-_CUER_WIDTH], cuer, points], axis=1))
        axes.set_title(_caption(key, time_s))
        axes.set_axis_off()
        said = " ".join(s.text for s in subtitles if s.start_s <= time_s < s.end_s)
        axes.text(12, 0.96 * size[1], textwrap.fill(said, _LINE), color="white", va="bottom")
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=100)


def _stillest(motion: Motion, voice: Voice, key: Key) -> float:
    """Return the time at which the hand holds a key, between its approach and the key's middle."""
    times = np.arange(key.start - _APPROACH_S, (key.start + key.end) / 2, 1 / _LOOK_HZ)
    speed = hand_speed(voice.reconstruct(sample_params(motion, times)), _LOOK_HZ)
    return float(times[np.argmin(speed)])


def _caption(key: Key, time_s: float) -> str:
    # A key that only a preview holds has no phones.
    told = "".join(key.phones) + ", " if key.phones else ""
    return f"{time_s:.2f} s: {told}shape {key.shape} at the {key.placement}"


def draw_keys(path: Path, sent: Motion, received: Motion) -> None:
    """Plot placements of the keys and hand parameters, sent and received, over time."""
    import matplotlib.figure

    figure = matplotlib.figure.Figure(figsize=(12, 6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for motion, level, colour, label in (
        (sent, 0.18, "tab:blue", "sent"),
        (received, -0.18, "tab:orange", "received"),
    ):
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
