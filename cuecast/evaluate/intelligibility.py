"""How well our speech is understood, by two recognisers.

Whisper base, which nobody here has made or taught, gives words; a phone recogniser of another
family (`cuecast.evaluate.phone_listener`) gives phones, without any words to guess from.

Material (``--clips``): a folder of recorded sounds with transcripts, as `cuecast voice build` reads
them; without, two hundred sentences of today. Each text is heard in several voices
(``--channels``): ``recorded``, the sound of the folder; ``espeak``, its own reading of the text by
espeak-ng; ``reader``, our speech of the built-in reader's units; ``units``, of those of espeak-ng;
``speaker``, our speech of units that are cut from every other recording of the folder, the rest is
said. The words understood are compared with the text word by word, and phone by phone, where words
that sound alike count as right. Voices of units get figures of naturalness besides
(`cuecast.evaluate.naturalness`): pairs of them stand for joins, and for cuts without a join.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from importlib import resources
from typing import Any

import numpy as np
import soundfile
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from codec.errors import CueError
from cuecast.dubbing.performance import unit_synthesiser
from cuecast.evaluate.listener import FS, Listener, french_listener
from cuecast.evaluate.naturalness import NaturalnessTally
from cuecast.evaluate.options import EvaluateOptions
from cuecast.evaluate.phone_listener import PhoneListener, second_listener
from synth.language.text.normalise import PAUSES, normalise
from synth.language.text.pronounce import phonemise
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.alignment.sound import mono
from synth.planning.scoring.text_score import score_of_text
from synth.units.concatenation.concatenation import ConcatenativeSynthesiser
from synth.units.recordings.archive import READER, RENDERED
from synth.units.recordings.speaker import Refusal, SpokenFile, read_transcripts, record_speaker
from synth.units.speech.espeak_voice import speak

VOICES = ("recorded", "speaker", "reader", "units", "espeak")

_UNITS = {"reader": READER, "units": RENDERED}

_OURS = ("speaker", *_UNITS)
"""Voices of units: how natural they are is measured, too."""

_SENTENCES = 32
"""Recordings of a folder that are judged at most."""

_WORDS_PER_MINUTE = 150
"""At which espeak-ng reads; our speech has about as many."""

Sound = NDArray[np.float64]
Row = dict[str, Any]


def evaluate(options: EvaluateOptions) -> list[Row]:
    """Return one row for each voice.

    Raises
    ------
    CueError
        If a recogniser is not installed, a voice is unknown, or one asks for recordings and there
        are none.
    """
    usual = VOICES if options.clips is not None else VOICES[2:]
    wanted = options.channels or usual
    for voice in wanted:
        if voice not in VOICES:
            raise CueError(f"unknown voice {voice!r}; known: {', '.join(VOICES)}")
        if voice not in usual:
            raise CueError(f"voice {voice!r} needs recordings with transcripts (--clips)")
    listeners = french_listener(options.folder), second_listener()
    said, kept = _material(options)
    rows = []
    for voice in wanted:
        options.say(f"listening to {len(said)} sentences: {voice}")
        tally = NaturalnessTally()
        speech = _speech(voice, kept, tally)
        row = _judged(voice, said, speech, *listeners)
        rows.append(row | (tally.row() if voice in _OURS else {}))
    return rows


def _material(options: EvaluateOptions) -> tuple[list[SpokenFile | str], list[SpokenFile]]:
    """Return the items to judge, and the recordings that may make a speaker."""
    if options.clips is None:
        text = resources.files("cuecast").joinpath("evaluate/modern.txt").read_text("utf-8")
        return list(text.splitlines()), []
    found = [u for u in read_transcripts(options.clips) if phonemise(u.text)]
    return list(found[::2][:_SENTENCES]), found[1::2]


def _speech(
    voice: str, kept: Sequence[SpokenFile], tally: NaturalnessTally
) -> Callable[[SpokenFile | str], Sound]:
    """Return what says a text in a voice, or plays it, at the listener's rate."""
    if voice == "recorded":
        return _recorded
    if voice == "espeak":
        return lambda item: mono(*speak(_text(item), words_per_minute=_WORDS_PER_MINUTE))
    own = _UNITS.get(voice)
    synthesiser = unit_synthesiser(load_voice(), own) if own else _speaker(kept)
    return lambda item: _said(synthesiser, _text(item), tally)


def _recorded(item: SpokenFile | str) -> Sound:
    assert isinstance(item, SpokenFile)
    try:
        samples, fs = soundfile.read(item.path)
    except (OSError, soundfile.SoundFileError) as error:
        raise CueError(f"{item.path}: cannot be read as sound: {error}") from error
    return mono(samples, fs)


def _speaker(kept: Sequence[SpokenFile]) -> ConcatenativeSynthesiser:
    """Return a speaker whose units come from recordings that are not judged.

    Raises
    ------
    CueError
        If none of them can be used.
    """
    voice = load_voice()
    cuer = GestureSynthesiser(voice.name, alignment="paper")
    made = [item for item in record_speaker(kept, cuer, voice) if not isinstance(item, Refusal)]
    taken = list(itertools.chain.from_iterable(made))
    if not taken:
        raise CueError(f"none of {len(kept)} recordings can make a speaker")
    return ConcatenativeSynthesiser(taken, voice)


def _said(synthesiser: ConcatenativeSynthesiser, text: str, tally: NaturalnessTally) -> Sound:
    score = score_of_text(text, start_s=0.5)
    return mono(tally.add(synthesiser.perform([score], start_s=0.0)), synthesiser.fs)


def _text(item: SpokenFile | str) -> str:
    return item if isinstance(item, str) else item.text


def _judged(
    voice: str,
    said: Sequence[SpokenFile | str],
    speech: Callable[[SpokenFile | str], Sound],
    listener: Listener,
    second: PhoneListener,
) -> Row:
    words, phones, again = (np.zeros(2, np.int64) for _ in range(3))
    right, length_s = 0, 0.0
    for item in said:
        sound = speech(item)
        heard = listener(sound)
        text = _text(item)
        words += errors(_words(text), _words(heard))
        wrong = errors(_phones(text), _phones(heard))
        phones += wrong
        again += errors(_phones(text), second(sound))
        right += int(wrong[0] == 0)
        length_s += len(sound) / FS
    return {
        "voice": voice,
        "sentences": len(said),
        "seconds": round(length_s, 1),
        "words": int(words[1]),
        "word_error": round(float(words[0] / max(words[1], 1)), 4),
        "phones": int(phones[1]),
        "phone_error": round(float(phones[0] / max(phones[1], 1)), 4),
        "second_phone_error": round(float(again[0] / max(again[1], 1)), 4),
        "sentences_right": right,
    }


def _words(text: str) -> list[str]:
    tokens = [token for token in normalise(text) if token not in PAUSES]
    return [part for token in tokens for part in token.lower().split("-")]


def _phones(text: str) -> list[str]:
    return [phone for word in phonemise(text) for phone in word.phones]


def errors(told: Sequence[str], heard: Sequence[str]) -> tuple[int, int]:
    """Return the least number of changes that lead from one line to the other, and its length.

    Changes are a symbol more, less, or another one (Levenshtein 1966).

    Examples
    --------
    >>> errors("le chat dort".split(), "le chien dort bien".split())
    (2, 3)
    """
    row = list(range(len(heard) + 1))
    for number, symbol in enumerate(told, 1):
        row = list(_next_row(row, number, symbol, heard))
    return row[-1], len(told)


def _next_row(row: list[int], number: int, symbol: str, heard: Sequence[str]) -> Iterator[int]:
    last = number
    yield last
    for (diagonal, above), other in zip(itertools.pairwise(row), heard, strict=True):
        last = min(last + 1, above + 1, diagonal + (symbol != other))
        yield last


def plot(results: list[Row], figure: Any) -> None:
    """Draw the share of words and phones that were not understood, by voice."""
    axes = figure.subplots()
    place = np.arange(len(results))
    bars = {"words": "word_error", "phones": "phone_error", "second ear": "second_phone_error"}
    for shift, (label, key) in enumerate(bars.items(), -1):
        values = [row.get(key, 0.0) for row in results]
        axes.bar(place + 0.27 * shift, values, width=0.27, label=label)
    axes.set_xticks(place, [row["voice"] for row in results])
    axes.set_ylabel("share not understood")
    axes.legend()
