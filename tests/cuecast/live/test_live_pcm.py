"""Plain samples through the playout: exchanged where marked ones are there, else as they were."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codec.errors import CueError
from cuecast.command.cli import main
from cuecast.demo.content import FS, make_sound
from cuecast.demo.run import as_srt
from cuecast.live.pcm import MarkedPcm, PcmForm, PcmPassage
from watermark.audio.receiver import AudioReceiver

FORM = PcmForm("s16le", FS, 2)


@pytest.mark.parametrize("kind", ["s16le", "s32le", "f32le"])
def test_samples_there_and_back(kind: str) -> None:
    form = PcmForm.read(f"{kind}:48000:2")
    x = np.random.default_rng(0).uniform(-1, 1, (100, 2)).astype(np.float32)
    np.testing.assert_allclose(form.floats(form.bytes(x)), x, atol=2**-15)


@pytest.mark.parametrize("text", ["s16le", "s16le:48000:9", "u8:48000:2", "s16le:11025:2", ""])
def test_forms_that_are_none(text: str) -> None:
    with pytest.raises(CueError):
        PcmForm.read(text)


def test_what_is_not_marked_passes() -> None:
    sent: list[Any] = []
    passage = PcmPassage(FORM, 0.1, lambda *message: sent.append(message))
    rng = np.random.default_rng(1)
    data = rng.bytes(4 * 4800)
    out, at, now_s = b"", 0, 0.0
    while at < len(data):
        size = int(rng.integers(1, 997))
        passage.take(data[at : at + size], now_s)
        at, now_s = at + size, now_s + 0.002
        for _, _, first, piece in sent:
            if not 1000 < first < 2000:
                passage.put(0, MarkedPcm(first, bytes(b ^ 1 for b in piece)))
        sent.clear()
        out += b"".join(passage.give(now_s))
    out += b"".join(passage.rest())
    assert len(out) == len(data)
    exchanged = np.frombuffer(out, "<i2") != np.frombuffer(data, "<i2")
    assert exchanged[:1000].all()
    assert not exchanged[2400:3600].any()
    assert exchanged[5000:].all()
    assert passage.figures["bypasses_total"] == 1


def test_a_line_of_samples_carries(tmp_path: Path) -> None:
    sound, subtitles = make_sound()
    (tmp_path / "a.srt").write_text(as_srt(subtitles[:3]), encoding="utf-8")
    (tmp_path / "a.raw").write_bytes(FORM.bytes(sound[: 7 * FS]))
    live = ["playout", str(tmp_path / "a.raw"), str(tmp_path / "b.raw"), "--low-delay"]
    given = [*live, "--samples", "s16le:48000:2", "--subtitles", str(tmp_path / "a.srt")]
    assert main(given) == 0
    before, after = ((tmp_path / name).read_bytes() for name in ("a.raw", "b.raw"))
    assert len(before) == len(after)
    receiver = AudioReceiver(FS, 2)
    found = [*receiver.process(FORM.floats(after)), *receiver.flush()]
    assert sum(one.l0 is not None for one in found) >= 9
