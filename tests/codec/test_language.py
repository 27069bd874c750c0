"""A second language through the codec: American English by its tables alone."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codec.cuer.movement import Movement
from codec.cuer.voice import load_voice, save_voice
from codec.cues.cueing import DEFAULT_OPTIONS, cue
from codec.cues.language import find_language, french, load_language
from codec.cues.score import Key, Phone, Score
from codec.cues.timeline import TICK_S, Sounding, to_line
from codec.errors import CueError, VoiceError
from codec.streamfile.file_score import read_common
from codec.streamfile.stream import decode_stream, encode_stream
from codec.superframe.compact_encoder import CompactEncoder
from codec.superframe.decoder import SuperframeDecoder
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.merging import MergedScore, join, join_line
from codec.superframe.payload import read_beginning
from codec.superframe.preview import part_of_preview
from codec.superframe.resynthesis.movements import movements
from codec.superframe.score_coding import ScorePart
from codec.superframe.superframe import merge_scores
from tests.codec.american import american_motion, american_voice, english, spoken
from tests.spec.test_bitstream_reference import as_reference

ROOT = Path(__file__).parents[2]
DOCUMENT = json.loads((ROOT / "spec/vectors/language.json").read_text(encoding="utf-8"))


def named(keys: tuple[Key, ...]) -> list[tuple[int, str]]:
    return [(key.shape, key.placement) for key in keys]


def numbers(joined: MergedScore) -> list[list[int]]:
    """Return number, start and end of keys, as vectors have them."""
    return [
        [
            english().key_number(key.shape, key.placement),
            round(key.start / TICK_S),
            round(key.end / TICK_S),
        ]
        for key in joined.every
    ]


@pytest.mark.vectors("language")
def test_vectors_of_superframes(case: dict[str, Any]) -> None:
    if "file" in case:
        data = bytes.fromhex(case["file"])
        told = read_common(data[27 : 27 + data[26]], range(4), english())
        assert told.line is not None
        joined = join_line(told.line, {0: ScorePart(0, 0, (), (), 0, told.options)})
        line = [[s.number, s.start, s.end] for s in joined.line]
        assert line == case["line"][1:]
        assert numbers(joined) == case["keys"]
        return
    content = read_beginning(bytes.fromhex(case["l0"]), english())
    previews = {str(d): [list(one) for one in found] for d, found in content.previews.items()}
    assert previews == case["previews"]
    for distance, keys in case["previewed"].items():
        part = part_of_preview(content.previews[int(distance)], english())
        assert numbers(join({0: part})) == keys
    if case["score"] is None:
        return
    assert content.part is not None
    score = as_reference(content.part)
    assert score is not None
    assert score | {"cheek": []} == case["score"]
    if "strokes" in case:
        joined = join({0: content.part})
        assert numbers(joined) == case["keys"]
        constants = Movement.from_array(np.array(DOCUMENT["movement"], dtype=np.float32))
        moves = movements(joined, constants, np.array(DOCUMENT["places"]))
        rows = zip(moves.key.tolist(), moves.leave.tolist(), moves.reach.tolist(), strict=True)
        assert [list(row) for row in rows][1:] == case["strokes"]


def test_diphthongs_and_moving_vowels_have_keys_of_their_own() -> None:
    score = spoken("t aɪ d ə g oʊ ʌ p eɪ".split())
    assert named(score.keys) == [
        (5, "side to throat"),
        (1, "side down"),
        (7, "side forward"),
        (5, "side down"),
        (1, "chin to throat"),
    ]


def test_the_hand_goes_on_within_a_key_whose_placement_moves() -> None:
    voice = american_voice()
    motion = american_motion(spoken(["t", "aɪ"], ticks=15))
    tips = voice.reconstruct(motion.params)[:, 63 + 7]  # nail of the index
    key = motion.score.keys[0]  # type: ignore[union-attr]
    frame = round(key.start / TICK_S)
    side, throat = tips[frame + 14], tips[frame + 40]
    assert np.linalg.norm(throat - side) > 50


@pytest.mark.parametrize("constant", [False, True])
def test_stream_files_keep_phones_and_keys(constant: bool) -> None:
    voice, score = american_voice(), spoken()
    motion = american_motion(score)
    data = encode_stream(motion, voice, rate_bps=1000, constant=constant, score="keep")
    again = decode_stream(data, voice)
    assert again.score is not None
    assert [p.symbol for p in again.score.phones] == [p.symbol for p in score.phones]
    assert named(again.score.keys) == named(score.keys)
    error = voice.reconstruct(again.params) - voice.reconstruct(motion.params[: len(again.params)])
    assert np.sqrt(np.square(error).sum(axis=-1).mean()) < 15


def test_superframes_on_air_with_losses() -> None:
    voice, score = american_voice(), spoken()
    motion = american_motion(score)
    encoder = SuperframeEncoder(voice, l0_bytes=40, l1_bytes=7, protected=True, filmed=False)
    frames = [encoder.encode(motion, k) for k in range(int(motion.duration_s / 0.64) + 1)]
    for lost in (set[int](), {3}, {5, 6}):
        decoder = SuperframeDecoder(voice, lips=True)
        for frame in frames:
            kept = frame.index not in lost
            decoder.take(frame.l0 if kept else None, frame.l1 if kept else None, frame.index)
        found = merge_scores(decoder.render(frame.index) for frame in frames[-9:])
        late = [key for key in score.keys if key.start >= 0.64 * frames[-9].index]
        told = {(round(key.start, 1), key.shape, key.placement) for key in late}
        heard = {(round(key.start, 1), key.shape, key.placement) for key in found.keys}
        if not lost:
            assert heard >= told
        assert heard <= {(round(k.start, 1), k.shape, k.placement) for k in score.keys}


def test_compact_superframes() -> None:
    voice, score = american_voice(), spoken(ticks=14)
    motion = american_motion(score)
    encoder = CompactEncoder(voice, l0_bytes=12)
    decoder, done = SuperframeDecoder(voice), []
    for k in range(int(motion.duration_s / 0.64) + 1):
        done.append(decoder.push(encoder.encode(motion, k).l0, None, k))
    assert named(merge_scores(done).keys) == named(score.keys)


def test_a_voice_file_names_its_language(tmp_path: Path) -> None:
    voice = american_voice()
    save_voice(voice, tmp_path / "american.npz")
    again = load_voice(tmp_path / "american.npz")
    assert again.language == english()
    assert again.identity == voice.identity
    with pytest.raises(CueError, match="are of a language that is not here"):
        find_language("0123456789abcdef")


def test_languages_do_not_mix() -> None:
    motion = american_motion(spoken())
    claire = load_voice("claire")
    with pytest.raises(CueError, match="French has no phone 'ð'"):
        to_line(motion.score)
    with pytest.raises(CueError, match="American English has no phone 'ʁ'"):
        list(cue([Phone("ʁ", 0, 1)], DEFAULT_OPTIONS.in_language(english())))
    score = Score((Phone("p", 0, 1),), (Key(0, 1, ("p",), 1, "cheek"),))
    with pytest.raises(CueError, match="American English has no placement 'cheek'"):
        to_line(score, DEFAULT_OPTIONS.in_language(english()))
    data = encode_stream(motion, american_voice(), rate_bps=1000)
    with pytest.raises(VoiceError, match="stream coded with tables"):
        decode_stream(data, claire)
    with pytest.raises(CueError, match="gesture table of 9 shapes, 6 placements and 38 phones"):
        replace(claire, language=english())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"phones": ["_", "a", "a"]}, "not the tables of a language"),
        ({"vowels": 3}, "vowels and their placements differ"),
        ({"placements": ["side", "rest"]}, "2 placements, not within 3..16"),
        (
            {"movement": {"side down": "side forward", "side forward": "side"}},
            "a movement from a placement that moves",
        ),
        ({"placement_without_vowel": "nose"}, "a placement that is not in its list"),
        ({"shape": None}, "not the tables of a language"),
    ],
)
def test_malformed_tables_are_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    path = ROOT / "spec/data/languages/american-english.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    document["language"] |= change
    (tmp_path / "x.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(CueError, match=message):
        load_language(tmp_path / "x.json")


def test_french_is_what_its_tables_say() -> None:
    one = french()
    sizes = one.n_phones, one.n_vowels, one.n_shapes, one.n_placements, one.silence
    assert sizes == (38, 16, 9, 6, 40)
    assert Sounding(37, 0, 1).number == one.number_of["ŋ"]
