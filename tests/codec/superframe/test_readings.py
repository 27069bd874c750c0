"""Compact superframes on real timing: labelled readings by two speakers, 1001 sentences each."""

import bisect
from pathlib import Path

import pytest

from codec.cues.cueing import DEFAULT_OPTIONS, cue
from codec.cues.phonology import PAUSE
from codec.cues.score import Phone, Score
from codec.cues.timeline import TICKS, to_line
from codec.superframe.merging import score_of
from codec.superframe.window import read_window
from codec.superframe.window_writer import WindowWriter
from cuecast.evaluate.coded import counted
from lab.durations import read_sentences

TEXTS = Path(__file__).resolve().parents[4] / "shared" / "data" / "text"
OPEN_O = "ɔ"
"""What the second speaker's labels call 0."""

LATE_S = 0.6
"""A key that is farther from its like is wrong, not late."""

READINGS = ("enst-camille-data.yaml", "upmc-pierre/upmc-pierre-data.yaml")


def reading(name: str) -> Score:
    """Return all sentences of a reading, one after another with the speaker's own pauses."""
    if not (TEXTS / name).exists():
        pytest.skip(f"shared data absent: text/{name}")
    time_s, phones = 0.0, list[Phone]()
    for symbols, lengths in read_sentences(TEXTS / name):
        for symbol, length in zip(symbols, lengths.tolist(), strict=True):
            if symbol != PAUSE:
                named = OPEN_O if symbol == "0" else symbol
                phones.append(Phone(named, time_s, time_s + length))
            time_s += length
    return Score(tuple(phones), tuple(cue(phones)))


SHARES = [(7, 0.985), (6, 0.955)]
"""Bytes of a superframe, and the share of keys that have to be right.

The second speaker's dense passages leave 31873 of 32199 at 7 bytes and 30900 at 6, since 2 of the
56 or 48 bits are the identity's; none of the writer's weights, tried to either side of its own at 7
bytes, gives more.
"""


@pytest.mark.slow
@pytest.mark.parametrize(("size", "share"), SHARES)
@pytest.mark.parametrize("name", READINGS)
def test_keys_of_real_readings_are_right_and_in_time(name: str, size: int, share: float) -> None:
    score = reading(name)
    line = to_line(score)
    writer = WindowWriter(line, DEFAULT_OPTIONS, "0" * 16, size)
    windows = {k: read_window(writer.l0(k)) for k in range(line.starts[-1] // TICKS + 2)}
    got = score_of(windows).keys
    total, right, _ = counted(score.keys, got)
    starts = [key.start for key in score.keys]
    wrong = 0
    for key in got:
        first, last = (bisect.bisect(starts, key.start + side) for side in (-LATE_S, LATE_S))
        wrong += str(key) not in {str(other) for other in score.keys[first:last]}
    print(f"{name}, {size} bytes: {total} keys, {right} right within 0.1 s, {wrong} wrong")
    assert right > share * total
    assert wrong < 0.003 * total
