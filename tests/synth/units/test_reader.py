"""The built-in reader: what the package holds of her, and that it speaks."""

import numpy as np
import pytest

from codec.cuer.voice import load_voice
from codec.cues.cueing import cue
from codec.cues.score import Phone, Score
from codec.errors import CueError
from synth.language.text.words import Word
from synth.planning.alignment.align import SpokenPassage
from synth.units.concatenation.concatenation import ConcatenativeSynthesiser
from synth.units.recordings.archive import READER_ASSET, read_archive, reader_recordings
from synth.units.recordings.fits import label_fits
from synth.units.recordings.groups import BreathGroup, breath_groups, joined_groups
from synth.units.recordings.recording import PackedSound, _unpacked


def test_the_reader_comes_with_the_package_and_speaks() -> None:
    voice = load_voice()
    recordings = reader_recordings(voice)
    assert recordings[0].motion.voice == voice.identity, "make synth/assets/margot again"
    assert sum(file.stat().st_size for file in READER_ASSET.iterdir()) < 10_000_000
    assert sum(len(recording.score.phones) for recording in recordings) > 15_000
    few = ConcatenativeSynthesiser(recordings[:40], voice)
    phones = tuple(
        Phone(symbol, 0.5 + 0.09 * i, 0.59 + 0.09 * i) for i, symbol in enumerate("bɛlavi")
    )
    said = list(few.perform([Score(phones, tuple(cue(phones)))], start_s=0.0))
    sound = np.concatenate([part.sound for part in said])
    spoken = sound[round(0.55 * few.fs) : round(1.0 * few.fs)]
    assert spoken.std() > 0.02 > 10 * sound[: round(0.3 * few.fs)].std()


def test_labels_carry_how_well_they_fit() -> None:
    recordings = read_archive(READER_ASSET)
    first = recordings[0]
    found = label_fits(first.sound, first.fs, first.score.phones)
    # The sound was judged before it was coded. Measured: .99 and .08.
    assert np.corrcoef(first.fits, found)[0, 1] > 0.95
    assert np.median(np.abs(first.fits - found)) < 0.15
    everything = np.concatenate([recording.fits for recording in recordings])
    assert everything.max() <= 0
    assert -0.3 < np.median(everything) < -0.1


def test_recordings_are_marked_at_one_polarity_and_without_holes() -> None:
    for recording in read_archive(READER_ASSET)[::20]:
        peaks = recording.marks.sample[recording.marks.voiced]
        assert recording.sound[peaks].mean() > 0
        at_s = peaks / recording.fs
        for time in np.flatnonzero(recording.track.f0 > 0) * recording.track.hop_s:
            assert np.abs(at_s - time).min() < 0.05


def test_damaged_sounds_are_refused() -> None:
    with pytest.raises(CueError, match="a sound cannot be read"):
        _unpacked(PackedSound(b"no sound", 10))
    packed = read_archive(READER_ASSET)[0].source
    assert isinstance(packed, PackedSound)
    with pytest.raises(CueError, match="not 10"):
        _unpacked(PackedSound(packed.data, 10))


def test_groups_far_apart_stay_apart() -> None:
    phone = Phone("a", 0.2, 0.8)
    groups = [BreathGroup(t, t + 1, (phone,)) for t in (0.0, 1.1, 5.0)]
    assert [(g.start_s, g.end_s) for g in joined_groups(groups)] == [(0.0, 2.1), (5.0, 6.0)]


def test_silence_holds_no_group() -> None:
    word = Word("oui", ("w", "i"), ".")
    assert breath_groups(SpokenPassage((word,), np.zeros(16_000))) == []
