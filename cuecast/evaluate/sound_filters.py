"""Injuries that a filter of FFmpeg makes: compression, widening, enhancement, noise reduction.

In: a programme, shape (n, channels), and its rate; out: the sound after the filter, of about the
same length. The filters are those of the FFmpeg inside PyAV, at the settings that are named here.
"""

import contextlib
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

Sound = NDArray[np.float32]

Filters = Sequence[tuple[str, str]]
"""Name and options of each filter in a row."""

NIGHT_MODE = (("acompressor", "threshold=0.01:ratio=8:attack=1:release=50:makeup=4"),)
"""Dynamic range control for late hours: 8:1 above -40 dBFS, 1 ms attack, 50 ms release, +12 dB."""

RADIO = (
    (
        "mcompand",
        r"args=0.005\,0.1 6 -47/-40\,-34/-34\,-17/-33 100 |"
        r" 0.003\,0.05 6 -47/-40\,-34/-34\,-17/-33 400 |"
        r" 0.000625\,0.0125 6 -47/-40\,-34/-34\,-15/-33 1600 |"
        r" 0.0001\,0.025 6 -47/-40\,-34/-34\,-31/-31\,-0/-30 6400 |"
        r" 0\,0.025 6 -38/-31\,-28/-28\,-0/-25 22000",
    ),
    ("alimiter", "level_in=4:limit=0.5:attack=1:release=50:level=disabled"),
)
"""Five bands with attacks of .1 to 5 ms and a limiter, as radio stations process: the values are
those that the manual of FFmpeg's filter gives for such a sound."""

WIDER = (("stereowiden", "delay=20:feedback=0.3:crossfeed=0.3:drymix=0.8"),)
"""Cross feed of the other channel 20 ms late."""

DIALOGUE = (("dialoguenhance", "original=1:enhance=1"), ("pan", "stereo|c0=c0+0.7*c2|c1=c1+0.7*c2"))
"""Speech extracted into a centre, and mixed to two channels."""

DENOISER = (("afftdn", "noise_reduction=20"),)
"""Spectral noise reduction by 20 dB."""


def filtered(x: Sound, fs: int, *, filters: Filters, stereo: bool = False) -> Sound:
    """Send a programme through filters.

    Parameters
    ----------
    x : ndarray of float32, shape (n, channels)
        Of more than two channels the first two are taken.
    fs : int
        Rate in Hz.
    filters : sequence of (str, str)
        Names and options.
    stereo : bool
        Whether mono is sent on two channels: some filters take nothing else.

    Returns
    -------
    ndarray of float32, shape (m, 1 or 2)
    """
    mono = x.shape[1] == 1
    sound = np.repeat(x, 2, axis=1) if mono and stereo else x[:, :2]
    layout = "mono" if sound.shape[1] == 1 else "stereo"
    graph: Any = av.filter.Graph()
    time_base = Fraction(1, fs)
    nodes = [graph.add_abuffer(sample_rate=fs, format="fltp", layout=layout, time_base=time_base)]
    nodes += [graph.add(name, options) for name, options in filters]
    nodes += [graph.add("aformat", "sample_fmts=fltp"), graph.add("abuffersink")]
    graph.link_nodes(*nodes)
    graph.configure()
    parts: list[NDArray[Any]] = []

    def pull() -> None:
        with contextlib.suppress(BlockingIOError, EOFError):
            while True:
                parts.append(nodes[-1].pull().to_ndarray())

    for first in range(0, len(sound), fs):
        block = np.ascontiguousarray(sound[first : first + fs].T)
        frame = av.AudioFrame.from_ndarray(block, format="fltp", layout=layout)
        frame.sample_rate, frame.pts = fs, first
        nodes[0].push(frame)
        pull()
    nodes[0].push(None)
    pull()
    return np.ascontiguousarray(np.concatenate(parts, axis=1).T, dtype=np.float32)
