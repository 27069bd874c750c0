"""Tests as folders: items, lists, answers, refusals."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import soundfile

from codec.cuer.layout import MARKERS, N_FACE
from codec.cuer.motion import load_motion, save_motion
from codec.cuer.voice import Voice, load_voice
from codec.errors import CueError
from cuecast.command.cli import main
from cuecast.practice import comprehension, pairs
from cuecast.practice.doubles import minimal_pairs
from cuecast.practice.items import lips_only, pair_items, text_item, through_channel
from cuecast.practice.results import figures
from cuecast.practice.session import SEEN, Answer, new_session, old_session, read_answers
from cuecast.practice.trial import ItemCondition, Trial, read_trial
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text

PAIRS = [("pain", "main"), ("rue", "roue")]

LIPS = [i for i, name in enumerate(MARKERS) if name[:2] in ("UL", "LL", "LC")]


@pytest.fixture(scope="module")
def voice() -> Voice:
    return load_voice()


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    folder = tmp_path_factory.mktemp("pairs")
    for name in ("items", "answers"):
        (folder / name).mkdir()
    return pairs.prepare(folder, "claire", pairs.PairsPlan(trials=4), seed=2, pairs=PAIRS)


def test_every_pair_has_other_keys() -> None:
    assert len(set(minimal_pairs())) == len(minimal_pairs()) > 80
    for words in minimal_pairs():
        first, second = (score_of_text(word) for word in words)
        assert len(first.phones) == len(second.phones), words
        assert [str(key) for key in first.keys] != [str(key) for key in second.keys], words


@pytest.mark.slow
def test_lips_of_a_pair_look_alike(voice: Voice) -> None:
    # Largest distance of a marker of the lips: 2.1 mm (coût, goût); a vowel moves them by 10.
    for words in minimal_pairs():
        first, second = (lips_only(motion, voice) for motion in pair_items(words, voice))
        apart = voice.reconstruct(first.params) - voice.reconstruct(second.params)
        assert np.linalg.norm(apart[:, LIPS], axis=-1).max() < 2.5, words
        assert not apart[:, N_FACE:].any(), words


def test_lips_only_keeps_the_face_and_rests_the_hand(voice: Voice) -> None:
    shown = pair_items(("pain", "main"), voice)[0]
    without = lips_only(shown, voice)
    face = [i for i, name in enumerate(shown.layout) if name.startswith("face.")]
    assert np.array_equal(shown.params[:, face], without.params[:, face])
    assert np.ptp(voice.reconstruct(without.params)[:, N_FACE:], axis=0).max() == 0


def test_the_channel_changes_the_motion_and_may_lose_all_of_it(voice: Voice) -> None:
    shown = pair_items(("pain", "main"), voice)[0]
    none, every = (
        through_channel(shown, voice, lost=lost, rng=np.random.default_rng(0)) for lost in (0, 1)
    )
    assert none.score is not None
    assert none.params.shape == every.params.shape == shown.params.shape
    assert [str(key) for key in none.score.keys] == ["41"]
    assert every.score is not None
    assert not every.score.keys
    with pytest.raises(CueError, match="a share of 2"):
        through_channel(shown, voice, lost=2, rng=np.random.default_rng(0))


def test_long_and_silent_texts_are_refused(voice: Voice) -> None:
    with pytest.raises(CueError, match="601 characters, the limit is 600"):
        text_item("a" * 601, voice)
    with pytest.raises(CueError, match="nothing in the text is spoken"):
        text_item("…", voice)
    with pytest.raises(CueError, match="equally many phones"):
        pair_items(("pain", "boisson"), voice)


def test_lists_are_balanced_and_come_again(trial: Trial) -> None:
    steps = trial.steps(1)
    assert steps == read_trial(trial.folder).steps(1)
    assert steps != trial.steps(2)
    assert Counter(step.condition for step in steps) == Counter(
        {
            ItemCondition(hand, display, channel): 4
            for hand in pairs.HANDS
            for display in pairs.DISPLAYS
            for channel in pairs.CHANNELS
        }
    )
    for condition in {step.condition for step in steps}:
        assert sum(step.target for step in steps if step.condition == condition) == 2
    for step in steps:
        assert step.choices[step.target] == step.item
        score = load_motion(trial.folder / step.motion).score
        assert score is not None
        if step.condition.channel == "clear":
            assert score.keys[0].phones == score_of_text(step.item).keys[0].phones


def test_answers_are_kept_and_a_session_goes_on(trial: Trial) -> None:
    session = new_session(trial)
    assert session.code == "P01"
    session.answer(0, Answer(1, 812.34, 49.9))
    for step, answer, message in (
        (0, Answer(0, 1), "on en est à l’étape 2"),
        (1, Answer(2, 1), "le choix 2 n’existe pas"),
        (1, Answer(SEEN, 1), "le choix -1"),
        (1, Answer(0, float("nan")), "nan n’est pas une durée"),
    ):
        with pytest.raises(CueError, match=message):
            session.answer(step, answer)
    again = old_session(trial, "p01")
    again.answer(1, Answer(0, 500.0))
    rows = read_answers(again.path)
    assert [row["answer"] for row in rows] == ["1", "0"]
    assert rows[0]["answer_ms"] == "812.3"
    assert rows[0]["right"] == str(int(session.steps[0].target == 1))
    assert new_session(trial).code == "P02"
    for code in ("P77", "Pierre", ""):
        with pytest.raises(CueError):
            old_session(trial, code)


def test_damaged_folders_are_refused(trial: Trial, tmp_path: Path) -> None:
    with pytest.raises(CueError, match=r"cuecast trial prepare makes"):
        read_trial(tmp_path)
    document = json.loads((trial.folder / "trial.json").read_text())
    for change in ({"format": 9}, {"kind": "x"}, {"pool": 3}, {"seed": "x"}):
        (tmp_path / "trial.json").write_text(json.dumps(document | change))
        with pytest.raises(CueError, match="not a test of this version"):
            read_trial(tmp_path)
    (tmp_path / "trial.json").write_text(json.dumps(document | {"pool": [{"words": 1}]}))
    with pytest.raises(CueError, match="malformed pool"):
        read_trial(tmp_path).steps(1)


def test_ratings_need_recordings_and_hold_three_sources(
    voice: Voice, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    takes = tmp_path / "takes"
    takes.mkdir()
    out = str(tmp_path / "out")
    line = ["trial", "prepare", "naturalness", "-o", out, "--recordings", str(takes)]
    assert main(line) == 3
    assert "at least 2 are needed" in capsys.readouterr().err
    for name, text in (("a", "Bonjour"), ("b", "Bonsoir madame")):
        motion = motion_of(score_of_text(text, start_s=0.5), voice)
        save_motion(motion, takes / f"{name}.npz")
        tone = 0.1 * np.sin(np.arange(round(motion.duration_s * 16000)) / 20)
        soundfile.write(takes / f"{name}.wav", tone, 16000)
    assert main(line) == 0
    made = read_trial(out)
    steps = made.steps(1)
    assert Counter((step.item, step.condition.source) for step in steps) == Counter(
        (item, source) for item in "ab" for source in ("natural", "synthetic", "other")
    )
    for step in steps:
        assert (made.folder / step.sound).is_file()
        assert len(load_motion(made.folder / step.motion).params) == len(
            load_motion(takes / f"{step.item}.npz").params
        )
    assert "PROTOCOLE" in (made.folder / "protocole.txt").read_text(encoding="utf-8")
    assert main(line) == 3
    assert "exists already" in capsys.readouterr().err
    (takes / "b.wav").unlink()
    assert main([*line[:4], str(tmp_path / "other"), *line[5:]]) == 3
    assert "no speech beside it" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()


def test_passages_and_conditions_form_a_latin_square(tmp_path: Path) -> None:
    (tmp_path / "items").mkdir()
    texts = tmp_path / "texts"
    texts.mkdir()
    for name in "abc":
        passage = {
            "title": name,
            "sentences": ["Oui.", "Non."],
            "questions": [{"text": "Quoi ?", "choices": ["oui", "non"], "right": 0}],
        }
        (texts / f"{name}.json").write_text(json.dumps(passage))
    made = comprehension.prepare(tmp_path, "claire", passages=texts)
    met = Counter(
        (step.item, step.condition.source)
        for number in range(1, 10)
        for step in made.steps(number)
        if step.motion
    )
    assert set(met.values()) == {3}
    assert len(met) == 9
    for step in made.steps(4):
        if step.choices:
            assert step.choices[step.target] == "oui"
        else:
            assert (step.captions == ()) == (step.condition.source == "cuer")
    (texts / "c.json").write_text('{"sentences": ["a"], "questions": [{"text": 1}]}')
    with pytest.raises(CueError, match=r"c.json: not a passage"):
        comprehension.prepare(tmp_path, "claire", passages=texts)


def test_two_voices_say_each_sentence_and_preferences_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    texts = tmp_path / "texts.txt"
    texts.write_text("Il pleut.\nOn part demain.\n", encoding="utf-8")
    out = str(tmp_path / "out")
    line = ["trial", "prepare", "voices", "-o", out, "--texts", str(texts), "--trials"]
    assert main([*line, "4"]) == 3
    assert "2 sentences, 4 are wanted" in capsys.readouterr().err
    assert main([*line, "2"]) == 0
    made = read_trial(out)
    steps = made.steps(1)
    sources = [step.condition.source for step in steps]
    assert sorted(sources) == ["espeak-reader", "reader-espeak"]
    for step in steps:
        sound, fs = soundfile.read(made.folder / step.sound)
        assert abs(len(sound) / fs - load_motion(made.folder / step.motion).duration_s) < 0.11
        silent = np.convolve(np.abs(sound) > 0, np.ones(round(0.8 * fs)), "valid").min()
        assert silent == 0, "a pause between the voices"
        loud = np.flatnonzero(sound)
        assert loud[0] < 0.05 * fs
    session = new_session(made)
    for number, source in enumerate(session.steps):
        first = source.condition.source.startswith("reader")
        session.answer(number, Answer(0 if first else 2, 900.0, 60.0))
    (row,) = figures(made)["conditions"]
    assert (row["source"], row["answers"]) == ("espeak over reader", 2)
    assert row["share"][0] == 0.25, "the reader once, both once"


def test_power_and_bad_options_of_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["trial", "power", "--d-prime", "2", "--participants", "10", "--json"]) == 0
    assert 0.9 < json.loads(capsys.readouterr().out)["power"] <= 1
    out = str(tmp_path / "t")
    for options, message in (
        (["pairs", "--trials", "5"], "an even number is needed"),
        (["pairs", "--hands", "feet"], "choose from lips, hand"),
        (["naturalness"], "needs --recordings"),
        (["voices", "--speakers", "reader"], "two or more of reader"),
        (["voices", "--trials", "3"], "half of them begin"),
        (["comprehension", "--displays", "points,avatar"], "takes one display"),
    ):
        assert main(["trial", "prepare", *options, "-o", out]) in (2, 3)
        assert message in capsys.readouterr().err
    assert main(["trial", "results", out]) == 3
    assert not Path(out).exists()
