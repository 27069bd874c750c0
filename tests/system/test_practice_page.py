"""The pages of learners and participants in Chromium."""

import asyncio
import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from codec.cuer.motion import save_motion
from codec.cuer.voice import load_voice
from cuecast.practice import comprehension, naturalness, pairs
from cuecast.practice.pages import LearnerPages, TrialPages
from cuecast.practice.papers import write_papers
from cuecast.practice.results import figures
from cuecast.practice.session import read_answers
from cuecast.practice.trial import Trial
from synth.motion.rules.performance import motion_of
from synth.planning.scoring.text_score import score_of_text
from tests.chromium import Page, browse

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
ARTEFACTS = ROOT / "artefacts" / "practice"
AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"
RULES = "{runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice']}"
VIOLATIONS = (
    f"axe.run(document, {RULES}).then((f) => JSON.stringify(f.violations.map((v) => v.id)))"
)
PENDING = "document.querySelectorAll('#box .answers button:not(:disabled)').length == 2"


async def check_access(page: Page) -> None:
    """Ask axe, where it is installed, for violations."""
    if AXE.is_file():
        await page.evaluate(AXE.read_text(encoding="utf-8") + "; 1")
        assert json.loads(await page.evaluate(VIOLATIONS)) == []


def test_a_participant_answers_by_keyboard(tmp_path: Path) -> None:
    for name in ("items", "answers"):
        (tmp_path / name).mkdir()
    plan = pairs.PairsPlan(hands=("hand",), displays=("points",), channels=("clear",), trials=2)
    trial = pairs.prepare(tmp_path, "claire", plan, pairs=[("pain", "main"), ("fou", "vous")])
    write_papers(trial)
    asyncio.run(_participate(trial))
    steps, rows = trial.steps(1), read_answers(tmp_path / "answers" / "P01.csv")
    # The first answer was right by its digit, the second wrong by an arrow.
    assert [row["right"] for row in rows] == ["1", "0"]
    assert [row["target"] for row in rows] == [str(step.target) for step in steps]
    for row in rows:
        assert 90 < float(row["answer_ms"]) < 20_000
        assert float(row["frames_per_second"]) > 0
    assert figures(trial)["participants"] == 1


async def _participate(trial: Trial) -> None:
    steps = trial.steps(1)
    async with TrialPages(trial).running() as url, browse(url) as page:
        await page.until("document.getElementById('begin')?.disabled === false")
        await check_access(page)
        await page.evaluate("document.getElementById('agree').click()")
        await page.evaluate("document.getElementById('start').requestSubmit()")
        for number, step in enumerate(steps):
            begun = f"document.getElementById('progress').textContent.startsWith('{number + 1} ')"
            await page.until(f"{PENDING} && {begun}")
            await asyncio.sleep(0.12)
            if number == 0:
                await check_access(page)
                await page.screenshot(ARTEFACTS / "trial.png")
                await page.press(str(step.target + 1), 49 + step.target)
            else:
                await page.press("ArrowLeft" if step.target else "ArrowRight", 37)
            await page.until(f"!({PENDING})")
        await page.until("!document.getElementById('thanks').hidden")
        assert page.errors == []
        assert all(request.startswith((url, "data:")) for request in page.requests)


def test_a_learner_loops_asks_and_prints() -> None:
    asyncio.run(_learn())


async def _learn() -> None:
    async with LearnerPages(load_voice()).running() as url, browse(url, 1280, 860) as page:
        await page.until("!!window.learner && !!learner.item")
        await page.evaluate("document.getElementById('form').requestSubmit()")
        await page.until("learner.player.timeS > 1.5")
        await check_access(page)
        await page.screenshot(ARTEFACTS / "learn.png")
        await page.evaluate("learner.loop(1)")
        await page.until("learner.shownNow === 1")
        start, end = await page.evaluate("[learner.player.run.from, learner.player.run.until]")
        for _ in range(20):
            assert start <= await page.evaluate("learner.player.timeS") <= end
            await asyncio.sleep(0.1)
        await page.evaluate("learner.player.stop(); learner.lastPhrase()")
        assert await page.evaluate("learner.player.run.from > 0 && !learner.player.run.loop")
        for name in ("doubles", "gestures"):
            await page.evaluate(f"document.querySelector('[data-view={name}]').click()")
            await page.evaluate(f"document.getElementById('{name}-start').click()")
            await page.until(f"document.querySelectorAll('#{name}-box .answers button').length > 1")
            await asyncio.sleep(3)
            await page.screenshot(ARTEFACTS / f"{name}.png")
            await page.press("1", 49)
            await page.until(f"!!document.querySelector('#{name}-box .main')")
            await check_access(page)
        await page.call("Page.navigate", url=f"{url}page/sheet.html?text=Bonjour%20papi")
        await page.until("document.querySelectorAll('.cells img').length === 5")
        await check_access(page)
        await page.screenshot(ARTEFACTS / "sheet.png")
        drawn = "[...document.images].map((one) => one.naturalWidth * one.naturalHeight)"
        assert min(await page.evaluate(drawn)) > 100_000
        await page.call("Page.navigate", url=f"{url}page/sheet.html")
        await page.until("document.querySelectorAll('.cells img').length === 13")
        assert page.errors == []
        assert all(request.startswith((url, "data:")) for request in page.requests)


@pytest.mark.parametrize("kind", ["naturalness", "comprehension"])
def test_ratings_and_passages_are_gone_through(kind: str, tmp_path: Path) -> None:
    made = tmp_path / "made"
    for name in ("items", "answers"):
        (made / name).mkdir(parents=True)
    if kind == "naturalness":
        _record(tmp_path)
        trial = naturalness.prepare(made, tmp_path, "claire")
    else:
        for name in "abc":
            passage = {
                "title": name,
                "sentences": ["Oui.", "Non."],
                "questions": [{"text": "Quoi ?", "choices": ["oui", "non"], "right": 0}],
            }
            (tmp_path / f"{name}.json").write_text(json.dumps(passage))
        trial = comprehension.prepare(made, "claire", passages=tmp_path, display="points")
    write_papers(trial)
    captions = asyncio.run(_go_through(trial))
    rows = read_answers(made / "answers" / "P01.csv")
    assert len(rows) == 6
    if kind == "naturalness":
        assert {row["source"] for row in rows} == {"natural", "synthetic", "other"}
        assert [row["mean"][0] for row in figures(trial)["conditions"]] == [2.0] * 3
    else:
        assert captions >= {"Oui.", "Non."}
        assert sum(row["answer"] != "" for row in rows) == 3


def _record(folder: Path) -> None:
    for name, text in (("a", "Bonjour"), ("b", "Bonsoir")):
        motion = motion_of(score_of_text(text, start_s=0.5), load_voice())
        save_motion(motion, folder / f"{name}.npz")
        tone = 0.1 * np.sin(np.arange(round(motion.duration_s * 16000)) / 20)
        soundfile.write(folder / f"{name}.wav", tone, 16000)


async def _go_through(trial: Trial) -> set[str]:
    """Answer "2" to everything; return the captions seen."""
    seen = set()
    async with TrialPages(trial).running() as url, browse(url) as page:
        await page.until("document.getElementById('begin')?.disabled === false")
        await page.evaluate("document.getElementById('agree').click()")
        await page.evaluate("document.getElementById('start').requestSubmit()")
        over = "!document.getElementById('thanks').hidden"
        status = "document.getElementById('status').textContent"
        while not await page.evaluate(over):
            assert await page.evaluate(status) == ""
            seen.add(await page.evaluate("document.getElementById('captions').innerText"))
            if await page.evaluate("!!document.querySelector('#box button:not(:disabled)')"):
                await page.screenshot(ARTEFACTS / f"{trial.kind}.png")
                await page.press("2", 50)
            await asyncio.sleep(0.1)
        assert page.errors == []
    return seen
