"""The identity of a coding as the specification says, from files alone."""

from pathlib import Path

import pytest

from codec.cuer.voice import load_voice
from codec.superframe.coding import coding_for, trained_path
from lab.format_tables import TABLES
from spec.reference.identity import identity


def test_the_built_in_voice_has_the_identity_of_its_files(tmp_path: Path) -> None:
    voice = load_voice()
    path = trained_path(voice)
    assert path is not None
    assert identity(TABLES, path, voice.identity) == coding_for(voice).identity
    changed = tmp_path / "tables.json"
    changed.write_bytes(TABLES.read_bytes().replace(b"[", b"[ ", 1))
    assert identity(changed, path, voice.identity) != coding_for(voice).identity
    assert identity(TABLES, path, "0" * 16) != coding_for(voice).identity
    with pytest.raises(FileNotFoundError):
        identity(tmp_path / "none.json", path, voice.identity)
