"""The GStreamer element: keys of marked sound as the subtitle track of a Matroska file."""

import os
import re
import shutil
import subprocess
import wave
from pathlib import Path

import av
import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.phonology import PHONES
from codec.cues.score import PLACEMENT_NUMBER
from receiver import KeysFound, Receiver
from receiver.export.device_voice import device_voice
from receiver.native.build import HERE, build_plugin
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text
from tests.receiver.air import FS, marked_noise

TEXT = "Bonjour à tous, voici le temps de demain matin."
SOURCE = HERE / "plugin" / "gstcuecast.c"


def test_symbols_are_those_of_the_specification() -> None:
    text = SOURCE.read_text(encoding="utf-8")
    listed = {
        name: re.findall(r'"([^"]*)"', text.split(f"{name}[] = {{")[1].split("};")[0])
        for name in ("PHONES", "PLACEMENTS")
    }
    assert listed["PHONES"] == ["", *PHONES[1:]]
    assert listed["PLACEMENTS"] == sorted(PLACEMENT_NUMBER, key=lambda p: PLACEMENT_NUMBER[p])


@pytest.fixture(scope="module")
def launch(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Return the command that runs a pipeline with the element, just built."""
    for program in ("cc", "pkg-config", "gst-launch-1.0"):
        if shutil.which(program) is None:
            pytest.skip(f"no {program}: apt-get install gstreamer1.0-tools pkg-config gcc")
    asked = ["pkg-config", "--exists", "gstreamer-audio-1.0"]
    if subprocess.run(asked, check=False).returncode:
        pytest.skip("no headers of GStreamer: apt-get install libgstreamer-plugins-base1.0-dev")
    folder = tmp_path_factory.mktemp("gst")
    build_plugin(["cc", "-Werror"], folder)
    return [
        "env",
        f"GST_PLUGIN_PATH={folder}",
        f"GST_REGISTRY={folder / 'registry'}",
        "gst-launch-1.0",
        "-q",
    ]


def run(launch: list[str], pipeline: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*launch, *pipeline.split()],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
        env=dict(os.environ),
    )


@pytest.mark.slow
def test_keys_as_subtitles(launch: list[str], tmp_path: Path) -> None:
    voice = load_voice()
    (tmp_path / "voice.bin").write_bytes(device_voice(voice))
    sound = marked_noise(voice, motion_of(score_of_text(TEXT, start_s=1.5), voice), 7)
    with wave.open(str(tmp_path / "sound.wav"), "wb") as file:
        file.setparams((1, 2, FS, 0, "NONE", ""))
        file.writeframes(np.rint(32767 * np.clip(sound, -1, 1)).astype("<i2").tobytes())
    box = Receiver(FS, 1)
    events = [*box.process(sound), *box.flush()]
    own = [
        (key.start, f"{''.join(key.phones)} {key.shape} {key.placement}\n")
        for e in events
        if isinstance(e, KeysFound) and e.final
        for key in e.keys
    ]
    assert len(own) > 10
    done = run(
        launch,
        f"filesrc location={tmp_path}/sound.wav ! wavparse ! audioconvert"
        f" ! cuecastkeys voice={tmp_path}/voice.bin ! matroskamux"
        f" ! filesink location={tmp_path}/keys.mkv",
    )
    assert done.returncode == 0, done.stderr
    with av.open(str(tmp_path / "keys.mkv")) as container:
        packets = [p for p in container.demux(subtitles=0) if p.pts is not None]
        found = [(float(p.pts * p.time_base), bytes(p).decode()) for p in packets]  # type: ignore[operator]
    assert [text for _, text in found] == [text for _, text in own]
    assert max(abs(a - b) for (a, _), (b, _) in zip(found, own, strict=True)) < 0.02


@pytest.mark.slow
def test_says_what_is_missing(launch: list[str], tmp_path: Path) -> None:
    (tmp_path / "voice.bin").write_bytes(b"no voice")
    sound = "audiotestsrc num-buffers=5"
    without = run(launch, f"{sound} ! cuecastkeys ! fakesink")
    damaged = run(launch, f"{sound} ! cuecastkeys voice={tmp_path}/voice.bin ! fakesink")
    assert without.returncode != 0
    assert "No voice: set voice=FILE" in without.stderr
    assert damaged.returncode != 0
    assert "The voice is not one of this version" in damaged.stderr
