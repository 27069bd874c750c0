"""Teach `synth.planning.alignment.recogniser` the phones of French.

Run as ``python -m lab.recogniser.train --whisper model.bin --speech DIR --texts FILE
--music DIR --voices DIR``. Whisper base (MIT licence) is the ear. The speech is that of June
Wallack for Asterisk (Debian's asterisk-core-sounds-fr-g722, CC BY-SA 3.0; its texts are in
asterisk-core-sounds-fr), the music that of asterisk-moh-opsound-g722, the voices that are made to
sing over it those of asterisk-core-sounds-en-g722, -es-, -it- and -ru-g722 (all CC BY-SA 3.0). A
first layer learns from renderings of espeak-ng, whose times are known; with it the recordings are
aligned, a second layer learns from both, and with that they are aligned again. The third layer
learns from the recordings as they are, over music and songs, slower and lower, and in noise. Every
tenth recording is kept out and gives the figure printed.
"""

import argparse
import gzip
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray
from scipy import signal

from codec.cues.phonology import PAUSE, PHONE_NUMBER, PHONES
from codec.cues.score import Phone
from codec.files.npz import write_arrays
from lab.recogniser.singing import songs
from lab.recogniser.whisper import ear_of, read_weights
from synth.language.text.espeak import RATE_HZ
from synth.language.text.pronounce import phonemise
from synth.language.text.sentences import read_sentences
from synth.planning.alignment.align import SpokenPassage, align_passages
from synth.planning.alignment.recogniser import (
    EAR_ASSET,
    FS,
    PHONES_ASSET,
    likely,
    listen,
    load_ear,
    load_phones,
)
from synth.planning.alignment.sound import mono
from synth.units.speech.espeak_voice import render

_FRAME_S = 0.02
"""Seconds between the ear's features."""

_TOGETHER_S = 14.0
"""Recordings are heard joined up to this length, as speech is in use."""

_RENDERED = 100
"""Sentences of renderings."""

_READ_AT_HZ = (RATE_HZ, 25_600, 19_000)
"""Rates as which renderings are read: as they are, from a shorter and a longer vocal tract."""

_SLOWER = (6, 5)
"""Ratio that makes recordings slower and lower as well, as if a man spoke."""

_BYTES_PER_S = 8_000
"""Of G.722."""

_SONGS_S = 240.0
"""Length of the songs that are made."""

_MUSIC_DB, _NOISE_DB = (-4.0, 10.0), (3.0, 20.0)
"""Range of the voice's strength over music and over noise in dB."""

_LEVEL = 0.05
"""Strength of each recording before it is joined to others, of full scale 1."""

_PASSES, _BATCH, _RATE, _DECAY = 3, 256, 2e-3, 1e-5
"""Passes over all frames, frames of a step, its first size, and the pull of weights to 0
(Adam: D. Kingma, J. Ba 2015)."""

_PRIOR_WEIGHT = 0.6
"""How much of the phones' usual shares is taken from the estimate."""

Sound = NDArray[np.float64]
Frames = tuple[NDArray[np.float32], NDArray[np.int64]]
"""Features and the number of the phone in each frame."""


@dataclass(frozen=True, slots=True)
class Spoken:
    """A recording and its phones."""

    sound: Sound
    phones: tuple[Phone, ...]


def read_sound(path: Path) -> Sound:
    """Return a G.722 file at `FS`."""
    with av.open(str(path), format="g722") as container:
        frames = [frame.to_ndarray().reshape(-1) for frame in container.decode(audio=0)]
        rate = container.streams.audio[0].rate
    return mono(np.concatenate(frames).astype(np.float64) / 32768, rate)


def read_sounds(folder: Path) -> list[Sound]:
    """Return the G.722 files below a folder that hold a second or more."""
    paths = sorted(folder.rglob("*.g722"))
    return [read_sound(path) for path in paths if path.stat().st_size >= _BYTES_PER_S]


def recorded(folder: Path, texts: Path) -> Iterator[SpokenPassage]:
    """Yield recordings whose text is known and has room."""
    known = {}
    for line in gzip.decompress(texts.read_bytes()).decode().splitlines():
        if found := re.match(r"([\w/.-]+): *([^\[(]+)$", line):
            known[found[1]] = found[2].strip(" “”")
    for path in sorted(folder.rglob("*.g722")):
        text = known.get(str(path.relative_to(folder).with_suffix(""))) or known.get(path.stem, "")
        words = tuple(phonemise(text))
        passage = SpokenPassage(words, read_sound(path))
        if words and passage.long_enough:
            yield passage


def rendered() -> list[Spoken]:
    """Return sentences of espeak-ng's voice, read as from vocal tracts of several lengths."""
    result = []
    for number, sentence in enumerate(read_sentences()[:_RENDERED]):
        line = [s for w in phonemise(sentence) for s in (*w.phones, *([PAUSE] if w.pause else []))]
        rendering = render(line, words_per_minute=(120, 150, 180, 210)[number % 4])
        read_at = _READ_AT_HZ[number % len(_READ_AT_HZ)]
        speed = RATE_HZ / read_at
        phones = tuple(Phone(p.symbol, speed * p.start, speed * p.end) for p in rendering.phones)
        result.append(Spoken(mono(rendering.samples, read_at), phones))
    return result


def joined(items: Sequence[Spoken]) -> Iterator[Spoken]:
    """Yield recordings joined to stretches of some seconds, equally loud."""
    sounds: list[Sound] = []
    phones: list[Phone] = []
    clock = 0.0
    for item in items:
        length_s = len(item.sound) / FS
        if sounds and clock + length_s > _TOGETHER_S:
            yield Spoken(np.concatenate(sounds), tuple(phones))
            sounds, phones, clock = [], [], 0.0
        sounds.append(item.sound / (item.sound.std() + 1e-9) * _LEVEL)
        phones += [Phone(p.symbol, p.start + clock, p.end + clock) for p in item.phones]
        clock += length_s
    if sounds:
        yield Spoken(np.concatenate(sounds), tuple(phones))


def slower(item: Spoken) -> Spoken:
    """Return a recording slower and lower."""
    up, down = _SLOWER
    phones = tuple(Phone(p.symbol, p.start * up / down, p.end * up / down) for p in item.phones)
    return Spoken(signal.resample_poly(item.sound, up, down), phones)


def over(item: Spoken, other: Sound, decibels: float) -> Spoken:
    """Return a recording that is stronger than another sound by so much."""
    gain = item.sound.std() / (other.std() + 1e-9) * 10 ** (-decibels / 20)
    return Spoken(item.sound + gain * other, item.phones)


def conditions(
    items: Sequence[Spoken], music: Sequence[Sound], sung: Sequence[Sound], rng: np.random.Generator
) -> Iterator[Spoken]:
    """Yield the recordings as they are, over music, over songs, and harder still.

    Harder are: slower over music, or in a narrow band with noise.
    """
    for number, item in enumerate(items):
        yield item
        yield over(item, _stretch(music, len(item.sound), rng), rng.uniform(*_MUSIC_DB))
        yield over(item, _stretch(sung, len(item.sound), rng), rng.uniform(*_MUSIC_DB))
        if number % 2:
            lower = slower(item)
            yield over(lower, _stretch(music, len(lower.sound), rng), rng.uniform(*_MUSIC_DB))
            continue
        noisy = over(item, rng.normal(size=len(item.sound)), rng.uniform(*_NOISE_DB))
        edges = [rng.uniform(80, 300), rng.uniform(3400, 6500)]
        band = signal.butter(4, edges, "bandpass", fs=FS, output="sos")
        yield Spoken(signal.sosfilt(band, noisy.sound), item.phones)


def _stretch(sounds: Sequence[Sound], length: int, rng: np.random.Generator) -> Sound:
    """Return so much of one of some sounds, from anywhere in it on."""
    piece = sounds[int(rng.integers(len(sounds)))]
    return np.resize(np.roll(piece, -int(rng.integers(len(piece)))), length)


def aligned(
    passages: Sequence[SpokenPassage], features: Sequence[NDArray[np.float32]]
) -> list[Spoken]:
    """Return the recordings whose words are all found, by the layer that is used now."""
    known = [
        replace(passage, heard=likely(found, len(passage.samples)))
        for passage, found in zip(passages, features, strict=True)
    ]
    return [
        Spoken(passage.samples, found.phones)
        for passage, found in zip(known, align_passages(known), strict=True)
        if found.spoken.all()
    ]


def frames_of(items: Iterator[Spoken]) -> Frames:
    """Return the ear's features and the number of the phone in each frame."""
    ear = load_ear()
    features, labels = [], []
    for item in items:
        found = listen(item.sound, ear)
        number = np.full(len(found), PHONE_NUMBER[PAUSE])
        for phone in item.phones:
            first, end = (int(np.ceil(t / _FRAME_S)) for t in (phone.start, phone.end))
            number[first:end] = PHONE_NUMBER[phone.symbol]
        features.append(found)
        labels.append(number)
    return np.concatenate(features), np.concatenate(labels)


def learn(frames: Frames, rng: np.random.Generator) -> dict[str, NDArray[np.float32]]:
    """Return the layer that predicts the labels best: a logistic regression."""
    features, labels = frames
    mean, spread = features.mean(axis=0), features.std(axis=0) + np.float32(1e-3)
    layer: list[NDArray[np.float32]] = [
        np.zeros((features.shape[1], len(PHONES)), np.float32),
        np.zeros(len(PHONES), np.float32),
    ]
    moments = [(np.zeros_like(p), np.zeros_like(p)) for p in layer]
    steps = _PASSES * (len(labels) // _BATCH)
    order = np.concatenate([rng.permutation(len(labels)) for _ in range(_PASSES)])
    for step in range(steps):
        chosen = order[step * _BATCH : (step + 1) * _BATCH]
        x = (features[chosen] - mean) / spread
        z = x @ layer[0] + layer[1]
        share = np.exp(z - z.max(axis=1, keepdims=True))
        share /= share.sum(axis=1, keepdims=True)
        share[np.arange(len(chosen)), labels[chosen]] -= 1
        slopes = (x.T @ share / len(chosen) + _DECAY * layer[0], share.mean(axis=0))
        rate = _RATE * (1 - step / steps)
        for value, (first, second), slope in zip(layer, moments, slopes, strict=True):
            first += 0.1 * (slope - first)
            second += 0.001 * (slope**2 - second)
            unbiased = np.sqrt(second / (1 - 0.999 ** (step + 1))) + 1e-8
            value -= rate * first / (1 - 0.9 ** (step + 1)) / unbiased
    weights = layer[0] / spread[:, None]
    counts = np.bincount(labels, minlength=len(PHONES)) + 50.0
    offsets = layer[1] - mean @ weights - _PRIOR_WEIGHT * np.log(counts / counts.sum())
    return {"weights": weights.astype(np.float32), "offsets": offsets.astype(np.float32)}


def keep(layer: dict[str, NDArray[np.float32]]) -> None:
    """Write the layer of phones and use it from now on."""
    write_arrays(PHONES_ASSET, layer)
    load_phones.cache_clear()


def main() -> None:
    """Write the two assets of the package."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--whisper", type=Path, required=True, help="model.bin of CTranslate2")
    parser.add_argument("--speech", type=Path, required=True, help="folder of recordings (.g722)")
    parser.add_argument("--texts", type=Path, required=True, help="what they say (.txt.gz)")
    parser.add_argument("--music", type=Path, required=True, help="folder of music (.g722)")
    parser.add_argument("--voices", type=Path, required=True, help="folder of voices (.g722)")
    options = parser.parse_args()
    write_arrays(EAR_ASSET, ear_of(read_weights(options.whisper)))
    load_ear.cache_clear()
    synthetic = frames_of(joined(rendered()))
    keep(learn(synthetic, np.random.default_rng(1)))
    passages = list(recorded(options.speech, options.texts))
    features = [listen(passage.samples, load_ear()) for passage in passages]
    items = aligned(passages, features)
    keep(learn(_together(frames_of(joined(items)), synthetic), np.random.default_rng(2)))
    items = aligned(passages, features)
    rng = np.random.default_rng(3)
    music, voices = read_sounds(options.music), read_sounds(options.voices)
    taught = [item for number, item in enumerate(items) if number % 10]
    sung = songs(voices, music, rng, _SONGS_S)
    natural = frames_of(conditions(list(joined(taught)), music, sung, rng))
    keep(learn(_together(natural, synthetic), np.random.default_rng(4)))
    found, labels = frames_of(joined(items[::10]))
    weights, offsets = load_phones()
    right = float((np.argmax(found @ weights + offsets, axis=1) == labels).mean())
    print(f"{len(items)} recordings; {right:.1%} of the frames that were kept out are right")


def _together(first: Frames, second: Frames) -> Frames:
    return np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])


if __name__ == "__main__":
    main()
