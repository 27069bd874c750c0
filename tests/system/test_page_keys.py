"""The lit key in a real browser: the one that the hand shows."""

import json
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.analysis.readability import Classes
from codec.cuer.layout import MARKERS
from codec.cuer.voice import load_voice
from codec.cues.score import PLACEMENT_NUMBER
from receiver.television import server
from receiver.television.tuner import MotionTuner
from synth.motion.rules.gesture import GestureSynthesiser
from synth.planning.prosody.pacing import READABLE
from synth.planning.scoring.text_score import Reading, score_of_text
from synth.studio.recital import sentences
from tests.chromium import Page
from tests.system.test_page import make_programme, watch

TEXT = (
    "Le vieux pêcheur range ses filets sur le port, et la mouette attend un poisson. "
    "Demain matin nous partirons de bonne heure voir les bateaux."
)

LIT = """(() => {{
    const [frame, at] = [window.requestAnimationFrame, cuecast.clock.at];
    window.requestAnimationFrame = () => 0;
    const found = [];
    for (let timeS = 0.5; timeS < {seconds}; timeS += 0.04) {{
        cuecast.clock.at = () => timeS;
        cuecast.tick(performance.now());
        const lit = document.querySelector('#keys li.now small');
        found.push([timeS, lit ? lit.textContent.split(' ')[0] : '']);
    }}
    [window.requestAnimationFrame, cuecast.clock.at] = [frame, at];
    return JSON.stringify(found);
}})()"""
"""What the page shows at each picture of the programme, drawn by its own loop."""


def nearest_key(
    names: Sequence[str], targets: NDArray[np.float32], markers: NDArray[np.float32]
) -> list[str]:
    """Return the nearest of the 40 keys by where all markers of the fingers are."""
    fingers = [i for i, name in enumerate(names) if re.fullmatch(r"F[1-5][1-3T]", name)]
    keys = targets[1:, 1:][:, :, fingers].reshape(40, -1)
    hands = markers[:, fingers].reshape(len(markers), -1)
    numbers = ((hands[:, None] - keys) ** 2).sum(axis=2).argmin(axis=1)
    return [f"{n % 5 + 1}{n // 5 + 1}" for n in numbers.tolist()]


@pytest.mark.parametrize(
    "text", [TEXT, pytest.param(" ".join(sentences(held_out=True)[20:32]), marks=pytest.mark.slow)]
)
def test_the_lit_key_is_the_hand_s_in_every_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    monkeypatch.setattr(server, "AHEAD_S", 300.0)  # all keys are there before the first picture
    voice = load_voice()
    score = score_of_text(text, start_s=1.0, reading=Reading(pace=READABLE))
    seconds = score.phones[-1].end
    cuer = GestureSynthesiser(rate_hz=50.0, seed=5)
    motion = cuer.motion(score, 0.0, round((seconds + 1) * cuer.rate_hz), voice)
    programme = make_programme(tmp_path / "bars.mp4", 320, 180, 25, seconds=round(seconds) + 1)
    found: list[list[str | float]] = []

    async def visit(page: Page) -> None:
        await page.until(f"cuecast.timeline.keys.length > {0.9 * len(score.keys)}")
        await page.evaluate("cuecast.settings.set('style', 'points')")
        found.extend(json.loads(await page.evaluate(LIT.format(seconds=seconds))))

    watch(programme, visit, MotionTuner(motion), voice=voice)
    times = np.array([float(time_s) for time_s, _ in found])
    markers = np.concatenate([cuer.markers(score, time_s, 1) for time_s in times.tolist()])
    shapes, placements = Classes(cuer.targets()[0]).distances(markers)
    shape = shapes.argmin(axis=1)
    place = placements[np.arange(len(times)), shape].argmin(axis=1)
    shown = right = 0
    around = [
        {
            f"{PLACEMENT_NUMBER[key.placement]}{key.shape}"
            for key in score.keys
            if abs(key.start - time_s) < 0.7
        }
        for time_s in times
    ]
    for number, ((_, lit), near) in enumerate(zip(found, around, strict=True)):
        hand = f"{place[number]}{shape[number]}"
        shown += hand in near
        right += hand in near and lit == hand
    print(f"{right} of {shown} pictures")
    assert shown > 80
    assert right >= 0.95 * shown
    nearest = nearest_key(MARKERS, cuer.targets()[0], markers)
    alike = [
        lit == key
        for (_, lit), key, near in zip(found, nearest, around, strict=True)
        if key in near
    ]
    print(f"{sum(alike)} of {len(alike)} pictures by the fingers' markers")
    assert np.mean(alike) >= 0.95
