"""The page's own computations, run by node or Chromium: the same numbers as Python's."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from codec.analysis.readability import Classes
from codec.cuer.movement import FLOWING
from codec.cuer.voice import load_voice
from codec.cues.cueing import cue
from codec.cues.score import PLACEMENT_NUMBER, Phone, Score
from codec.cues.timeline import TICK_S, to_line
from codec.superframe.merging import join
from codec.superframe.resynthesis.movements import movements
from codec.superframe.resynthesis.targets import PARTS_PER_S, Targets
from codec.superframe.score_coding import part_of
from receiver.drawing.voice_document import neutral_camera, voice_document
from receiver.reception.events import MotionPiece
from receiver.television.protocol import pack_motion
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.prosody.pacing import READABLE
from synth.planning.scoring.text_score import Reading, score_of_text
from tests.receiver.node import PAGE, run_node
from tests.receiver.standin import make_motion, make_voice

VOICE = make_voice()
MOTION = make_motion(VOICE)


def test_markers_equal_python_within_a_micrometre(tmp_path: Path) -> None:
    params = np.concatenate([MOTION.params[::40], np.zeros((1, len(VOICE.layout)))])
    script = """
        import { VoiceModel } from "./model.js";
        const model = new VoiceModel(data.voice);
        const out = new Float64Array(339);
        console.log(JSON.stringify(data.params.map((p) => Array.from(model.reconstruct(p, out)))));
    """
    found = run_node(tmp_path, script, {"voice": voice_document(VOICE), "params": params.tolist()})
    expected = VOICE.reconstruct(params)
    error = np.abs(np.array(found).reshape(expected.shape) - expected)
    assert error.max() < 1e-3  # float32 of Python's result: 6e-5 mm measured


def test_camera_equals_python(tmp_path: Path) -> None:
    markers = VOICE.reconstruct(MOTION.params[7:8])[0]
    script = """
        import { PointLights } from "./points.js";
        const canvas = { width: 860, height: 1000, getContext: () => ({}) };
        const lights = new PointLights(canvas, { markers: new Array(113), camera: data.camera });
        lights.project(data.markers, false);
        console.log(JSON.stringify([Array.from(lights.xy), Array.from(lights.scale)]));
    """
    document = voice_document(VOICE)
    xy, scale = run_node(
        tmp_path, script, {"camera": document["camera"], "markers": markers.ravel().tolist()}
    )
    view = neutral_camera(VOICE).project(markers)
    assert np.allclose(np.reshape(xy, (-1, 2)), view[:, :2] * 1000 + [430, 500], atol=1e-6)
    assert np.allclose(scale, view[:, 2], atol=1e-9)


def pieces(shuffled: bool) -> list[list[int]]:
    """Messages of the motion's superframes, duplicates and concealed twins among them."""
    parts = [
        MotionPiece(MOTION.start_s + at / 50, 50.0, MOTION.params[at : at + 32], ("L0",))
        for at in range(0, len(MOTION.params) - 31, 32)
    ]
    blank = [
        MotionPiece(p.start_s, 50.0, np.zeros_like(p.params), ()) for p in (parts[3], parts[5])
    ]
    order = [parts[5], blank[1], *parts[6:], *parts[:3], blank[0], *parts[3:5], parts[1]]
    return [list(pack_motion(piece)) for piece in (order if shuffled else parts)]


SAMPLE = """
    import { parseMotion } from "./feed.js";
    import { Timeline } from "./timeline.js";
    const timeline = new Timeline();
    for (const bytes of data.pieces) timeline.insert(parseMotion(new Uint8Array(bytes).buffer));
    const out = new Float64Array(data.width);
    console.log(JSON.stringify(data.times.map((t) => [timeline.sample(t, out), ...out])));
"""


def test_motion_is_interpolated_across_pieces_in_any_order(tmp_path: Path) -> None:
    times = np.arange(0.05, 7.5, 0.0137)
    data = {"times": times.tolist(), "width": len(VOICE.layout), "pieces": pieces(shuffled=True)}
    found = np.array(run_node(tmp_path, SAMPLE, data))
    rates = np.linspace(0.2, 1.0, len(VOICE.layout))
    truth = 0.7 * np.sin(2 * np.pi * np.outer(times, rates) + rates * 9)
    assert (found[:, 0] == 1).all()
    assert np.abs(found[:, 1:] - truth).max() < 1e-3


def test_lost_motion_is_held_and_faded(tmp_path: Path) -> None:
    kept = pieces(shuffled=False)
    del kept[5:8]
    times = [3.0, 3.2 + 0.3, 3.2 + 0.35 + 0.225, 4.1, 5.12, 9.9]
    data = {"times": times, "width": len(VOICE.layout), "pieces": kept}
    found = np.array(run_node(tmp_path, SAMPLE, data))
    assert np.allclose(found[:, 0], [1, 1, 0.5, 0, 1, 0], atol=1e-6)
    assert np.allclose(found[1, 1:], MOTION.params[159], atol=1e-6)
    assert np.allclose(found[4, 1:], MOTION.params[256], atol=1e-6)


def test_truncated_message_is_refused(tmp_path: Path) -> None:
    script = """
        import { parseMotion } from "./feed.js";
        let message = "";
        try { parseMotion(new Uint8Array(data).buffer); } catch (error) { message = error.message; }
        console.log(JSON.stringify(message));
    """
    found = run_node(tmp_path, script, pieces(shuffled=False)[0][:-4])
    assert found == f"motion message of {20 + 4 * 32 * len(VOICE.layout) - 4} bytes is malformed"


def test_keys_come_once_and_in_order(tmp_path: Path) -> None:
    keys = [key.as_dict() for key in MOTION.score.keys] if MOTION.score else []
    script = """
        import { Timeline } from "./timeline.js";
        const timeline = new Timeline(data.movement);
        timeline.insertKeys(data.keys.slice(5, 12));
        timeline.insertKeys(data.keys.slice(0, 8));
        timeline.insertKeys(data.keys.slice(10));
        const around = timeline.keysAround(data.keys[3].start, 1, 1);
        console.log(JSON.stringify([timeline.keys, around, timeline.keysAround(-9, 1, 1)]));
    """
    document = {"keys": keys, "movement": voice_document(VOICE)["movement"]}
    found, around, before = run_node(tmp_path, script, document)
    assert found == keys
    assert around == {"keys": keys[2:5], "now": 1}
    assert before["now"] == -1


LIT = """
    import { Timeline } from "./timeline.js";
    import { VoiceModel } from "./model.js";
    import { HandReader } from "./hand.js";
    const model = new VoiceModel(data.voice);
    const reader = new HandReader(model);
    const markers = new Float64Array(3 * model.markers.length);
    const timeline = new Timeline(model.movement);
    timeline.insertKeys(data.keys);
    const lit = data.times.map((timeS, i) => {
        model.reconstruct(data.params[i], markers);
        const { keys, now } = timeline.keysAround(timeS, 0, 0, data.reads && reader.read(markers));
        return now < 0 ? -1 : keys[now].start;
    });
    console.log(JSON.stringify(lit));
"""


@pytest.mark.parametrize("reads", [True, False])
def test_the_lit_key_is_the_one_that_the_hand_shows(tmp_path: Path, reads: bool) -> None:
    """Nearest class of shape and placement, on the cuer's own markers, decides what is shown."""
    text = "Le patron du café raconte une belle histoire à ses amis, puis il ferme la porte."
    score = score_of_text(text, start_s=1.0, reading=Reading(pace=READABLE))
    rate_hz, frames = 50.0, int(50 * (score.phones[-1].end + 1))
    voice = load_voice()
    cuer = GestureSynthesiser(rate_hz=rate_hz)
    times = np.arange(frames) / rate_hz
    document = {
        "voice": voice_document(voice),
        "keys": [key.as_dict() for key in score.keys],
        "params": cuer.motion(score, 0.0, frames, voice).params.tolist(),
        "times": times.tolist(),
        "reads": reads,
    }
    lit = np.array(run_node(tmp_path, LIT, document))
    shown, right = agreement(lit, times, cuer, score)
    assert shown > 0.6 * frames
    # Measured 0.97 and 0.96: by the clock alone where no hand is drawn.
    assert right >= (0.95 if reads else 0.92) * shown


def agreement(
    lit: np.ndarray, times: np.ndarray, cuer: GestureSynthesiser, score: Score
) -> tuple[int, int]:
    """Return at how many times the hand shows a key, and at how many of these that one is lit."""
    markers = np.concatenate([cuer.markers(score, time_s, 1) for time_s in times.tolist()])
    shapes, placements = Classes(cuer.targets()[0]).distances(markers)
    shape = shapes.argmin(axis=1)
    place = placements[np.arange(len(times)), shape].argmin(axis=1)
    starts = np.array([key.start for key in score.keys])
    code = [(key.shape, PLACEMENT_NUMBER[key.placement]) for key in score.keys]
    shown = right = 0
    for frame, time_s in enumerate(times):
        near = np.flatnonzero(np.abs(starts - time_s) < 0.7)
        classes = {int(i) for i in near if code[i] == (shape[frame], place[frame])}
        shown += bool(classes)
        right += bool(classes & set(np.flatnonzero(np.abs(starts - lit[frame]) < 1e-3).tolist()))
    return shown, right


def test_the_page_times_strokes_as_the_decoder_does(tmp_path: Path) -> None:
    voice = load_voice()
    score = score_of_text("Le petit chat boit du lait. Il dort.", start_s=1.0)
    phones = []
    for key in score.keys:  # the page takes half of a key for its consonant
        start, end = (TICK_S * round(t / TICK_S) for t in (key.start, key.end))
        edges = np.linspace(start, end, len(key.phones) + 1)
        phones += [Phone(p, *pair) for p, pair in zip(key.phones, pairwise(edges), strict=True)]
    keys = tuple(cue(phones))
    line = to_line(Score(tuple(phones), keys))
    parts = {k: part_of(line, k) for k in range(8)}
    moves = movements(join(parts), FLOWING, Targets.of(voice).places)
    expected = [
        (leave, reach)
        for key, leave, reach in zip(moves.key, moves.leave, moves.reach, strict=True)
        if key
    ]
    script = """
        import { strokesTo } from "./keys.js";
        const strokes = strokesTo(data.keys, data.movement);
        console.log(JSON.stringify(strokes.map(({ leave, reach }) => [leave, reach])));
    """
    document = {
        "keys": [key.as_dict() for key in keys],
        "movement": voice_document(voice)["movement"],
    }
    found = np.array(run_node(tmp_path, script, document))
    assert len(expected) == len(keys)
    np.testing.assert_allclose(found, np.array(expected) / PARTS_PER_S, atol=TICK_S)


def test_state_follows_the_clock(tmp_path: Path) -> None:
    script = """
        import { Timeline } from "./timeline.js";
        const timeline = new Timeline();
        for (const change of data) timeline.insertState(change);
        console.log(JSON.stringify([0, 2, 5, 9].map((t) => timeline.stateAt(t) || "none")));
    """
    changes = [(1, "searching"), (2, "locked"), (8, "lost"), (4, "degraded")]
    found = run_node(tmp_path, script, [{"time_s": t, "state": s} for t, s in changes])
    assert found == ["none", "locked", "degraded", "degraded"]


def test_page_is_small_and_needs_nothing_from_elsewhere() -> None:
    files = [file for file in PAGE.iterdir() if file.is_file()]
    assert sum(file.stat().st_size for file in files) < 1_000_000
    for file in files:
        if file.suffix in {".html", ".css", ".js"}:
            text = file.read_text(encoding="utf-8")
            assert "http://" not in text
            assert "https://" not in text
            assert "import(" not in text


def test_both_languages_have_the_same_words(tmp_path: Path) -> None:
    script = """
        import { TEXTS } from "./texts.js";
        console.log(JSON.stringify([Object.keys(TEXTS.fr), Object.keys(TEXTS.en)]));
    """
    french, english = run_node(tmp_path, script, None)
    assert french == english
