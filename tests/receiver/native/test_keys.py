"""From marked sound to keys: the native receiver gives those of the toolkit's own."""

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENT_NUMBER
from receiver import KeysFound, Receiver
from receiver.export.device_voice import device_voice
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text
from tests.receiver.air import FS, marked_noise
from tests.receiver.native.building import built

TEXT = "Bonjour à tous, voici le temps de demain matin."


@pytest.mark.slow
def test_keys_of_marked_sound(tmp_path: Path) -> None:
    voice = load_voice()
    (tmp_path / "voice.bin").write_bytes(device_voice(voice))
    motion = motion_of(score_of_text(TEXT, start_s=1.5), voice)
    sound = marked_noise(voice, motion, 7)
    box = Receiver(FS, 1)
    events = [e for i in range(0, len(sound), FS) for e in box.process(sound[i : i + FS])]
    events += box.flush()
    own = {
        (round(key.start * 50), round((key.end - key.start) * 50), key.shape, key.placement)
        for e in events
        if isinstance(e, KeysFound) and e.final
        for key in e.keys
    }
    command = [built("cue_dec"), "--channels", "1", "--voice", str(tmp_path / "voice.bin")]
    done = subprocess.run(command, input=sound.tobytes(), capture_output=True, check=True)
    found, frames = set(), dict[float, int]()
    places = {number: name for name, number in PLACEMENT_NUMBER.items()}
    for line in done.stdout.decode().splitlines():
        event = json.loads(line)
        if event["kind"] == "key" and event["final"] and event["duration_s"] > 0:
            start, length = round(event["time_s"] * 50), round(event["duration_s"] * 50)
            found.add((start, length, event["shape"], places[event["placement"]]))
        if event["kind"] == "motion":
            frames[round(event["time_s"] * 50)] = len(event["values"])
    assert len(own) > 10
    assert found == own
    assert set(np.diff(sorted(frames))) == {1}
    assert set(frames.values()) == {len(voice.layout)}
