"""The native receiver's timeline: what it believes of superframes that leave the grid."""

import subprocess
from pathlib import Path

from codec.cuer.voice import load_voice
from receiver.export.device_voice import device_voice
from tests.receiver.native.building import built
from tests.receiver.reception.test_tracking import compact_superframes
from tests.receiver.standin import make_voice


def drawn(voice: str, sent: list[tuple[float, bytes]]) -> list[int]:
    """Frames that each of the superframes sent gives."""
    lines = "\n".join(f"{time_s:.3f} {l0.hex()}" for time_s, l0 in sent)
    done = subprocess.run(
        [built("arrivals"), voice], input=lines, capture_output=True, text=True, check=True
    )
    counts = [0] * len(sent)
    for line in done.stdout.splitlines():
        counts[int(line.split()[0])] += 1
    return counts


def test_a_compact_stream_that_leaves_the_grid_takes_four_superframes(tmp_path: Path) -> None:
    voice = load_voice()
    path = tmp_path / "voice.bin"
    path.write_bytes(device_voice(voice))
    ours = compact_superframes(voice)
    found = drawn(str(path), [*ours[:6], *((t + 0.3, l0) for t, l0 in ours[6:])])
    assert all(found[:6])
    assert found[6:9] == [0, 0, 0]
    assert all(found[9:])
    for seed in range(1, 4):
        theirs = compact_superframes(make_voice(seed))
        for first in range(10):
            start_s = ours[2][0] + 0.3 - theirs[first][0]
            sent = [*ours[:2], *((start_s + t, l0) for t, l0 in theirs[first:])]
            assert not any(drawn(str(path), sent)[2:])
