"""The voice file of devices: size, what it holds, and what it refuses."""

import hashlib
import json
import zlib
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.voice import arrays_of as voice_arrays
from codec.cuer.voice import load_voice
from codec.errors import VoiceError
from codec.superframe.coding import arrays_of as coding_arrays
from codec.superframe.coding import coding_for
from cuecast.command.cli import main
from receiver.export.device_voice import device_voice, packed
from tests.codec.american import american_voice

VOICE = load_voice()


def test_size_digest_and_identities() -> None:
    data = device_voice(VOICE)
    assert data[:8] == b"CUEVOICE"
    assert int.from_bytes(data[32:36], "little") == len(data)
    assert hashlib.sha256(data[:-32]).digest() == data[-32:]
    assert data[16:24].hex() == coding_for(VOICE).identity
    assert data[24:32].hex() == VOICE.identity
    # 143 762 for the voice of 2026-11-22
    assert len(zlib.compress(data, 9)) <= 150_000


def test_more_parameters_than_receivers_have_room_for() -> None:
    coding = dict(coding_arrays(coding_for(VOICE))) | {"mean": np.zeros(32, np.float32)}
    with pytest.raises(VoiceError, match="32 parameters, receivers have room for 31"):
        packed(dict(voice_arrays(VOICE)), coding, 16 * "0", 16 * "0")


def test_another_language_is_refused() -> None:
    with pytest.raises(VoiceError, match="American English: devices"):
        device_voice(american_voice())


def test_verb(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["voice", "export", "--json", "-o", str(tmp_path / "v.bin")]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (tmp_path / "v.bin").read_bytes() == device_voice(VOICE)
    assert facts["bytes"] == len(device_voice(VOICE))
