"""One meter for all motion: streams, sources, and what a subtitle is told."""

import numpy as np
import pytest

from codec.analysis.readability import HELD_S, Shown, classes_of
from codec.cuer.voice import load_voice
from codec.cues.score import Key
from cuecast.dubbing.motions import SynthesisedMotion, ruled_motion, whole_motion
from cuecast.dubbing.readability import VisibilityMeter, watched
from synth.language.subtitles import Subtitle
from synth.motion.rules.bodiless import ruled_cuer
from synth.planning.prosody.pace_report import PaceReport
from synth.planning.prosody.pacing import READABLE
from synth.planning.scoring.text_score import Reading, score_of_subtitles, stream_score

LINES = [
    Subtitle(1.0 + 20.0 * n, 5.0 + 20.0 * n, text, n + 1)
    for n, text in enumerate(("Le chat dort.", "Il fait beau.", "La nuit vient."))
]


@pytest.fixture(scope="module")
def source() -> SynthesisedMotion:
    score = score_of_subtitles(LINES, reading=Reading(pace=READABLE))
    return SynthesisedMotion(score, load_voice())


def test_parts_change_nothing(source: SynthesisedMotion) -> None:
    voice = load_voice()
    motion = whole_motion(source, 50.0)
    markers = voice.reconstruct(motion.params)
    whole = VisibilityMeter(classes_of(voice), 50.0)
    whole.add(markers, 0.0, source.score.keys)
    parts = VisibilityMeter(classes_of(voice), 50.0)
    keys = list(source.score.keys)
    for at in range(0, len(markers), 77):
        until_s = (at + 77) / 50.0
        due = [key for key in keys if key.end <= until_s]
        keys = keys[len(due) :]
        parts.add(markers[at : at + 77], at / 50.0, due)
    parts.add(markers[:0], 50.0, keys)
    assert parts.figures() == whole.figures()
    assert watched(source, voice).figures() == whole.figures()
    assert whole.figures()["keys"] == len(source.score.keys)
    assert whole.figures()["held_share"] == 1.0


def test_a_long_text_made_in_passages_is_seen_as_the_whole() -> None:
    """Passages are longer than what is looked at together; a fifth of the keys stood for 0 ms."""
    voice, reading = load_voice(), Reading(pace=READABLE)
    said = "Il a bien soif, dit-elle en riant."
    lines = [Subtitle(t, t + 2.4, said, n) for n, t in enumerate(np.arange(1.0, 145.0, 3.0), 1)]
    seen = VisibilityMeter(classes_of(voice), 50.0)
    for part in ruled_motion(stream_score(lines, reading=reading), ruled_cuer(voice), voice):
        keys = part.score.keys if part.score else ()
        seen.add(voice.reconstruct(part.params), part.start_s, keys)
    score = score_of_subtitles(lines, reading=reading)
    source = SynthesisedMotion(score, voice)
    assert seen.figures() == watched(source, voice).figures()
    assert seen.figures()["keys"] == len(score.keys) > 500
    assert seen.figures()["three_pictures_share"] == 1.0


def test_what_stands_still_for_a_moment_is_told() -> None:
    report, warned = PaceReport(), list[str]()
    told = PaceReport(warn=warned.append)
    score = score_of_subtitles(LINES, reading=Reading(pace=READABLE), on_word=told)
    last = score.keys[-1]
    told.seen([Shown(key, key.start, 0.11 if key is last else 0.2) for key in score.keys])
    rows = told.report()["subtitles"]
    assert [row["short_keys"] for row in rows] == [0, 0, 1]
    assert [row["readable"] for row in rows] == [True, True, False]
    assert warned == [
        "subtitle at 41.00 s (line 3): 1 of 5 keys stand for less than three pictures"
    ]
    report.seen([Shown(Key(0.0, 1.0, ("a",), 5, "side"), 0.0, 0.0)])
    assert report.report()["subtitles"] == []


def test_nothing_said_is_nothing_seen() -> None:
    seen = VisibilityMeter(classes_of(load_voice()), 50.0)
    assert seen.figures()["keys"] == 0
    assert seen.figures()["peak_m_s"] == 0.0
    assert np.isclose(HELD_S, 0.1)
