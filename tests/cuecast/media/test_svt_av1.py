"""After SVT-AV1 was opened, every thread has the class that it had: it matters to root alone."""

import os
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from cuecast.dubbing.picture_coder import PictureStream
from cuecast.media.picture import rewrite_picture

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").is_dir(), reason="threads are looked at in Linux's way"
)


@pytest.fixture
def usual() -> Iterator[int]:
    """The class of this process, given back if a test fails."""
    own = os.sched_getscheduler(0)
    yield own
    os.sched_setscheduler(0, own, os.sched_param(0))


def classes() -> set[int]:
    return {os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")}


def test_a_picture_coder_leaves_the_machine_to_others(usual: int) -> None:
    stream = PictureStream("av1:300k", 320, 180, Fraction(25), 8)
    assert classes() == {usual}
    stream.process(np.full((180, 320), 100, np.uint8))
    assert classes() == {usual}


def test_a_rewritten_film_leaves_the_machine_to_others(tmp_path: Path, usual: int) -> None:
    with av.open(str(tmp_path / "in.mkv"), "w") as film:
        stream = film.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = 320, 180, "yuv420p"
        frame = av.VideoFrame.from_ndarray(np.full((270, 320), 100, np.uint8), format="yuv420p")
        for count in range(3):
            frame.pts = count
            film.mux(stream.encode(frame))
        film.mux(stream.encode(None))
    seen = []
    rewrite_picture(
        tmp_path / "in.mkv",
        tmp_path / "out.mkv",
        lambda form: [],
        codec="libsvtav1",
        progress=lambda seconds: seen.append(classes()),
    )
    assert seen == 3 * [{usual}]
