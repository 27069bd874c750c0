"""The identity of coding tables, and where they are kept."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.errors import VoiceError
from codec.streamfile.stream import decode_stream, encode_stream
from codec.superframe import coding as module
from codec.superframe.coding import Coding, coding_for, derive_coding, keep_coding, trained_path
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.transform import Basis
from tests.codec.speech import SENTENCE, spoken


@pytest.fixture
def motion(toy_voice: Voice) -> Motion:
    blank = np.zeros((256, len(toy_voice.layout)), np.float32)
    return Motion(blank, 50, 0.0, toy_voice.layout, toy_voice.identity, spoken(SENTENCE))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A user's folder of their own; tables that are found there are forgotten afterwards."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    yield tmp_path / "cuecast" / "coding"
    module._cached.cache_clear()


def trained(voice: Voice) -> Coding:
    return replace(derive_coding(voice), trained=True)


def test_identity_is_that_of_voice_format_and_tables(toy_voice: Voice) -> None:
    coding = trained(toy_voice)
    moved = replace(coding, mean=coding.mean + 1e-3)
    other = replace(coding, voice="0" * 16)
    assert len({coding.identity, moved.identity, other.identity}) == 3
    assert replace(coding).identity == coding.identity
    changed = replace(coding.language, digest=coding.language.digest[::-1])
    assert replace(coding, language=changed).identity != coding.identity


def test_derived_tables_are_the_same_up_to_their_last_bits(toy_voice: Voice) -> None:
    coding = derive_coding(toy_voice)
    assert replace(coding, mean=coding.mean * (1 + 1e-6)).identity == coding.identity
    finer = Basis(coding.plain.matrix, coding.plain.scales + 1)
    assert replace(coding, plain=finer).identity != coding.identity
    assert coding.identity != trained(toy_voice).identity


def test_tables_are_found_in_the_users_folder(toy_voice: Voice, folder: Path) -> None:
    assert trained_path(toy_voice) is None
    assert not coding_for(toy_voice).trained
    path = keep_coding(trained(toy_voice))
    assert path == trained_path(toy_voice) == folder / f"{toy_voice.identity}.npz"
    assert coding_for(toy_voice).trained
    assert coding_for(toy_voice).identity == trained(toy_voice).identity


@pytest.mark.parametrize("l0_bytes", [7, 27])
def test_streams_of_other_tables_are_refused(
    toy_voice: Voice, motion: Motion, folder: Path, l0_bytes: int
) -> None:
    encoder = (
        CompactEncoder(toy_voice, l0_bytes=l0_bytes)
        if l0_bytes == 7
        else SuperframeEncoder(toy_voice, l0_bytes=l0_bytes, l1_bytes=0)
    )
    frames = [encoder.encode(motion, k) for k in range(16)]
    for frame in frames:
        SuperframeDecoder(toy_voice).push(frame.l0, None, frame.index)
    keep_coding(trained(toy_voice))
    refused, decoder = list[str](), SuperframeDecoder(toy_voice)
    for frame in frames:
        try:
            assert decoder.push(frame.l0, None, frame.index).concealed or l0_bytes == 7
        except VoiceError as error:
            refused.append(str(error))
    # Two bits of a compact superframe agree by chance in a quarter; a check hardly ever.
    assert len(refused) >= (6 if l0_bytes == 7 else 14)
    assert all(text.startswith("another voice, language or coding tables:") for text in refused)


def test_files_of_other_tables_are_refused(toy_voice: Voice, motion: Motion, folder: Path) -> None:
    data = encode_stream(motion, toy_voice, rate_bps=400, score="keep")
    assert decode_stream(data, toy_voice).score is not None
    keep_coding(trained(toy_voice))
    with pytest.raises(VoiceError, match="those of voice toy here are"):
        decode_stream(data, toy_voice)


def test_damaged_tables_are_an_error(toy_voice: Voice, folder: Path) -> None:
    path = keep_coding(trained(toy_voice))
    path.write_bytes(path.read_bytes()[:-200])
    module._cached.cache_clear()
    with pytest.raises(Exception, match="damaged or foreign file"):
        coding_for(toy_voice)
