"""What the pages of learners and participants get from their server."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from codec.cuer.voice import load_voice
from cuecast.practice import pairs
from cuecast.practice.pages import LearnerPages, TrialPages
from cuecast.practice.papers import write_papers
from cuecast.practice.session import read_answers
from cuecast.practice.trial import Trial

Visit = Callable[[aiohttp.ClientSession, str], Awaitable[None]]


def visited(pages: LearnerPages | TrialPages, visit: Visit) -> None:
    async def run() -> None:
        async with pages.running() as url, aiohttp.ClientSession() as session:
            await visit(session, url)

    asyncio.run(run())


async def got(session: aiohttp.ClientSession, url: str) -> tuple[int, Any]:
    async with session.get(url) as answer:
        body = await answer.read()
        is_json = answer.content_type == "application/json"
        return answer.status, json.loads(body) if is_json else body


async def put(session: aiohttp.ClientSession, url: str, body: Any) -> tuple[int, Any]:
    async with session.post(url, data=json.dumps(body)) as answer:
        return answer.status, await answer.json()


@pytest.fixture
def trial(tmp_path: Path) -> Trial:
    for name in ("items", "answers"):
        (tmp_path / name).mkdir()
    plan = pairs.PairsPlan(displays=("points",), channels=("clear",), trials=2)
    made = pairs.prepare(tmp_path, "claire", plan, pairs=[("pain", "main")])
    write_papers(made)
    return made


def test_a_learner_gets_items_and_refusals() -> None:
    async def visit(session: aiohttp.ClientSession, url: str) -> None:
        status, item = await got(session, f"{url}item.json?text=Bon&hand=1")
        assert status == 200
        assert [key["placement"] for key in item["keys"]] == ["mouth"]
        shown, resting = [
            (await got(session, f"{url}item.bin?text=Bon&hand={hand}"))[1] for hand in (1, 0)
        ]
        assert len(shown) == len(resting) == 20 + 4 * 31 * round(50 * item["duration_s"])
        assert shown != resting
        status, item = await got(session, f"{url}item.json?family=pain&text=main")
        assert status == 200
        for query, message in (
            ("text=", "nothing in the text"),
            (f"text={'a' * 700}", "the limit is 600"),
            ("family=pain&text=chien", "pas un des sosies"),
        ):
            status, refusal = await got(session, f"{url}item.json?{query}")
            assert status == 400
            assert message in refusal["error"]
        status, quiz = await got(session, f"{url}doubles.json?seed=3")
        assert (status, quiz) == await got(session, f"{url}doubles.json?seed=3")
        assert len(quiz) == 10
        assert all(0 <= one["right"] < len(one["words"]) for one in quiz)
        assert (await got(session, f"{url}doubles.json?seed=-1"))[0] == 400
        assert b"Apprendre" in (await got(session, url))[1]
        assert (await got(session, f"{url}page/pages.py"))[0] == 404

    visited(LearnerPages(load_voice()), visit)


def test_a_participant_never_gets_the_answer(trial: Trial) -> None:
    async def visit(session: aiohttp.ClientSession, url: str) -> None:
        status, about = await got(session, f"{url}trial.json")
        assert len(about["consent"]) > 4
        assert (await put(session, f"{url}start", {"consent": False}))[0] == 400
        status, progress = await put(session, f"{url}start", {"consent": True})
        assert progress == {"code": "P01", "next": 0, "steps": 4, "ended": False}
        steps = trial.steps(1)
        for number, step in enumerate(steps):
            _, shown = await got(session, f"{url}step.json?code=P01")
            assert set(shown) == {
                "step", "prompt", "choices", "display", "moves", "sound", "captions",
            }  # fmt: skip
            assert tuple(shown["choices"]) == step.choices
            body = (await got(session, f"{url}step.bin?code=P01"))[1]
            assert len(body) > 1000
            answer = {"code": "P01", "step": number, "choice": 0, "answer_ms": 500.0}
            assert (await put(session, f"{url}answer", answer))[0] == 400
            answer["frames_per_second"] = 60
            status, progress = await put(session, f"{url}answer", answer)
            assert status == 200
        assert progress["ended"]
        assert (await got(session, f"{url}step.json?code=P01"))[0] == 400
        wrong: list[Any] = [{"code": "P09"}, [], {"code": "P01", "step": 9}]
        for bad in wrong:
            assert (await put(session, f"{url}answer", bad))[0] == 400
        assert (await put(session, f"{url}start", {"consent": True, "code": "P44"}))[0] == 400

    visited(TrialPages(trial), visit)
    assert len(read_answers(trial.folder / "answers" / "P01.csv")) == 4
