"""Questions in text and subtitles: which phones know of them, and that the voice rises there."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import soundfile as sf
from numpy.typing import NDArray

from codec.cuer.voice import load_voice
from codec.cues.phonology import VOWELS
from codec.cues.score import Phone, Score
from codec.errors import CueError
from cuecast.dubbing.performance import perform
from synth.language.subtitles import Subtitle
from synth.language.subtitles.read import parse_subtitles
from synth.language.text.espeak import RATE_HZ
from synth.language.text.pronounce import phonemise
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.alignment.score import align, on_grid, sound_of
from synth.planning.prosody.intonation import asks_with_a_word
from synth.planning.prosody.melody import plan_melody
from synth.planning.scoring.text_score import score_of_subtitles, score_of_text, stream_score
from synth.units.concatenation.concatenation import ConcatenativeSynthesiser
from synth.units.recordings.rendered import record
from synth.units.speech.espeak_voice import render

VOICED = frozenset(VOWELS) | frozenset("mnlvzʒjwɥbdg")

RISES = (
    "Tu viens ?", "Est-ce que tu viens ?", "Viens-tu ?", "Tu sais où il va ?", "Tu pars quand ?",
    "C'est qui ?", "Et toi ?", "Quoi ?", "Comment ?", "Quoi ?!", "Quoi !?", "N'est-ce pas ?",
    "Quand il pleut, tu sors ?", "Qui que tu sois, tu viens ?", "Qui vient, hein ?",
    "Quoi qu'il arrive, tu restes ?", "Si on sortait ?", "« Tu viens ? »", "TU VIENS ?",
    "Vous voulez du thé ?...", "Que tu viennes, ça te plaît ?", "Quand même ?", "Ou Paul ?",
)  # fmt: skip
FALLS = (
    "Qui vient ?", "Où vas-tu ?", "Et où vas-tu ?", "D'où viens-tu ?", "À quelle heure pars-tu ?",
    "Qu'est-ce que tu fais ?", "Qu'est-ce qu'il y a ?", "Que fais-tu ?", "Que se passe-t-il ?",
    "Quand pars-tu, Paul ?", "Quand est-ce qu'on mange ?", "Pourquoi ?", "Pourquoi pas ?",
    "Paul, où vas-tu ?", "Jusqu'à quand ?", "Depuis combien de temps dors-tu ?", "Lequel veux-tu ?",
    "Il demande : « Où vas-tu ? »", "Combien ça coûte ?!", "OÙ VAS-TU ?", "Qui est-ce qui vient ?",
    "Mais pourquoi donc ?", "De quoi parles-tu ?", "Comment ça va ?",
)  # fmt: skip


@pytest.mark.parametrize("text", RISES)
def test_a_question(text: str) -> None:
    assert score_of_text(text).phones[-1].contour == "question"


@pytest.mark.parametrize("text", FALLS)
def test_a_question_with_an_asking_word_first(text: str) -> None:
    assert asks_with_a_word(phonemise(text))
    assert score_of_text(text).phones[-1].contour == "interrogation"


def marks(score: Score) -> list[str]:
    """Return the contours that phones of a score know, in order."""
    return [phone.contour for phone in score.phones if phone.contour]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "Elle part, ce soir. Tu viens ? Oui !",
            ["continuation", "statement", "question", "exclamation"],
        ),
        ("« Tu viens ? » demanda-t-il.", ["question", "statement"]),
        ("— Tu viens ?\n— Où ça ?", ["question", "interrogation"]),
        ('Il a dit : "Qui est là ?" et il est parti', ["continuation", "interrogation"]),
        ("Il sait qui tu es.", ["statement"]),
        ("Oui", []),
    ],
)
def test_sentences_of_one_subtitle(text: str, expected: list[str]) -> None:
    assert marks(score_of_subtitles([Subtitle(1.0, 6.0, text)])) == expected


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        ("Pourquoi est-ce que", "tu ne viens pas ?", ["continuation", "interrogation"]),
        ("Est-ce que tu viens...", "avec nous demain ?", ["statement", "question"]),
        ("Est-ce que tu viens", "avec nous demain ?", ["continuation", "question"]),
        ("Où est", "Paul ?", ["interrogation"]),
        ("Où est-il", "Tu viens ?", ["interrogation"]),
        ("Tu viens ?", "Non.", ["question", "statement"]),
    ],
)
def test_a_question_over_two_subtitles(first: str, second: str, expected: list[str]) -> None:
    change_s = 1.0 + 0.07 * len(first)
    subtitles = [Subtitle(1.0, change_s, first), Subtitle(change_s + 0.1, change_s + 2, second)]
    assert marks(score_of_subtitles(subtitles)) == expected
    pieces = list(stream_score(subtitles))
    assert [mark for piece in pieces for mark in marks(piece)] == expected


def test_a_new_sentence_after_a_pause_forgets_the_asking_word() -> None:
    subtitles = [Subtitle(1.0, 2.0, "Où est-il"), Subtitle(5.0, 6.0, "Tu viens ?")]
    assert marks(score_of_subtitles(subtitles)) == ["question"]


def test_words_without_room_leave_their_mark_to_those_before() -> None:
    crowded = "Est-ce que tu viens avec nous demain matin à la gare de la ville voisine ?"
    score = score_of_subtitles(
        [Subtitle(1.0, 1.6, crowded), Subtitle(1.6, 4.0, "Oui.")], warn=lambda line: None
    )
    assert len(score.phones) < len(score_of_text(crowded).phones)
    assert marks(score) == ["question", "statement"]


def test_a_recording_keeps_the_marks() -> None:
    text = "Est-ce que tu viens avec nous demain ? Nous partons de bonne heure."
    words = phonemise(text)
    spoken = render([s for w in words for s in (*w.phones, *(["_"] if w.pause else []))])
    length_s = len(spoken.samples) / RATE_HZ
    subtitles = [Subtitle(0.0, length_s, text)]
    score = align(subtitles, sound_of(spoken.samples, RATE_HZ), warn=lambda line: None)
    assert marks(score) == ["question", "statement"]
    assert [p.contour for p in on_grid([Phone("a", 0.0, 0.1, "question")])] == ["question"]


def test_contours_stand_in_no_file_and_no_comparison() -> None:
    plain, asked = Phone("a", 0.0, 0.1), Phone("a", 0.0, 0.1, "question")
    assert plain == asked
    assert repr(plain) == repr(asked)
    assert Score((plain,), ()).to_json() == Score((asked,), ()).to_json()
    assert Score((asked,), ()).shifted(1.0).phones[0].contour == "question"
    with pytest.raises(CueError, match="unknown contour 'loud'"):
        Phone("a", 0.0, 0.1, "loud")
    asked_score, told = score_of_text("Tu viens demain ?"), score_of_text("Tu viens demain.")
    assert asked_score == told
    assert asked_score.to_json() == told.to_json()


def test_a_sentence_ends_where_the_text_says() -> None:
    line = [Phone("a", 0.0, 0.2, "continuation"), Phone("a", 0.7, 0.9, "statement")]
    late, near = np.array([0.2]), np.array([0.0])
    assert plan_melody(line).at(late)[0] > plan_melody(line).at(near)[0]
    unknown = [Phone(p.symbol, p.start, p.end) for p in line]
    assert plan_melody(unknown).at(late)[0] < plan_melody(unknown).at(near)[0]
    joined = [Phone("a", 0.0, 0.2, "question"), Phone("a", 0.2, 0.4, "statement")]
    curve = plan_melody(joined)
    assert curve.at(np.array([0.19]))[0] > 1.3 * curve.at(np.array([0.21]))[0]


def f0_of(x: NDArray[np.float64], fs: int, start_s: float, end_s: float) -> NDArray[np.float64]:
    """Return the pitch in Hz every 10 ms by plain autocorrelation of 40 ms."""
    found = []
    lags = np.arange(int(fs / 400), int(fs / 75))
    for at in np.arange(start_s, end_s, 0.01):
        frame = x[round((at - 0.02) * fs) :][: round(0.04 * fs) + lags[-1]]
        n = len(frame) - lags[-1]
        still = frame[:n]
        alike = [
            float(still @ frame[lag : lag + n])
            / (1e-9 + float(np.linalg.norm(still) * np.linalg.norm(frame[lag : lag + n])))
            for lag in lags
        ]
        best = max(alike)
        if best > 0.6:
            # The shortest lag nearly as good as the best is the period, not twice it.
            first = next(k for k, value in enumerate(alike) if value > 0.93 * best)
            peak = first + int(np.argmax(alike[first : first + 8]))
            found.append(fs / lags[peak])
    return np.array(found)


@pytest.fixture(scope="module")
def synthesiser() -> ConcatenativeSynthesiser:
    voice = load_voice("claire")
    texts = (
        "Tu viens demain matin avec nous.",
        "Où vas-tu demain, mon ami ?",
        "Est-ce que vous voulez une table ?",
        "Bonjour, madame, il fait beau ce soir.",
        "Elle part à Paris. Oui, nous allons au village.",
    )
    recordings = list(record(texts, GestureSynthesiser(alignment="paper"), voice))
    return ConcatenativeSynthesiser(recordings, voice)


SUBTITLES = b"""1
00:00:01,000 --> 00:00:03,500
Elle vient demain. Tu viens demain ?

2
00:00:05,000 --> 00:00:06,800
O\xc3\xb9 vas-tu demain ?

3
00:00:08,000 --> 00:00:09,500
Est-ce que tu vas

4
00:00:09,600 --> 00:00:11,000
\xc2\xab au village ?! \xc2\xbb
"""


def test_the_voice_rises_where_subtitles_ask(
    synthesiser: ConcatenativeSynthesiser, tmp_path: Path
) -> None:
    score = score_of_subtitles(parse_subtitles(SUBTITLES))
    target = tmp_path / "said.wav"
    for _ in perform([score], synthesiser, rate_hz=50.0, speech=str(target)):
        pass
    x, fs = sf.read(target)
    begin = 0
    moved: list[tuple[str, float, float]] = []
    for end in range(len(score.phones)):
        phone = score.phones[end]
        if phone.contour in ("", "continuation"):
            continue
        sentence = score.phones[begin : end + 1]
        begin = end + 1
        pitch = np.concatenate(
            [f0_of(x, fs, p.start, p.end) for p in sentence if p.symbol in VOICED]
        )
        vowel = next(p for p in reversed(sentence) if p.symbol in VOWELS)
        last = f0_of(x, fs, vowel.end - 0.05, vowel.end)
        middle = float(np.median(pitch))
        start = float(np.median(pitch[:6]))
        moved.append((phone.contour, float(np.median(last)) / middle, start / middle))
    kinds = [kind for kind, *_ in moved]
    assert kinds == ["statement", "question", "interrogation", "question"]
    end_of = [end for _, end, _ in moved]
    # Five sentences hold few falling ends. Measured: the statement ends 1.8 semitones below its
    # middle, with units that keep their own durations.
    assert end_of[0] < 0.92
    assert end_of[1] > 1.15
    assert end_of[2] < 0.9
    assert end_of[3] > 1.15
    # An interrogation starts 2 semitones or more above its own middle, a statement does not.
    assert moved[2][2] > 1.08 > moved[0][2]


def test_an_independent_pitch_tracker_agrees(
    synthesiser: ConcatenativeSynthesiser, tmp_path: Path
) -> None:
    parselmouth = pytest.importorskip("parselmouth", reason="needs praat-parselmouth (GPL)")
    rises = {}
    for text in ("Tu viens demain.", "Tu viens demain ?", "Où vas-tu demain ?"):
        score = score_of_text(text, start_s=1.0)
        sound = np.concatenate([p.sound for p in synthesiser.perform([score], start_s=0.0)])
        pitch = parselmouth.Sound(sound.astype(np.float64), synthesiser.fs).to_pitch_ac(
            time_step=0.01, pitch_floor=75.0, pitch_ceiling=450.0
        )
        at, f0 = pitch.xs(), pitch.selected_array["frequency"]
        inside = (f0 > 0) & (at > score.phones[0].start) & (at < score.phones[-1].end)
        rises[text] = float(np.median(f0[inside][-5:]) / np.median(f0[inside]))
    falling, rising, asking = rises.values()
    assert rising > 1.15
    assert max(falling, asking) < 0.9


def test_pieces_do_not_change_the_melody(synthesiser: ConcatenativeSynthesiser) -> None:
    subtitles = parse_subtitles(SUBTITLES)
    whole = list(synthesiser.perform([score_of_subtitles(subtitles)], start_s=0.0))
    parts = list(synthesiser.perform(stream_score(subtitles), start_s=0.0))
    for a, b in itertools.zip_longest(whole, parts):
        np.testing.assert_array_equal(a.sound, b.sound)
