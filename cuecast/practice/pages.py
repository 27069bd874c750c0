"""The pages of learners and participants, served to this machine.

Both show items by the scripts of the television's page and collect answers. The learner's page
makes items of any text; the participant's shows the steps of a prepared test one by one and never
gets the right answer.
"""

import asyncio
import contextlib
import json
import mimetypes
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from aiohttp import web

from codec.cuer.motion import Motion, load_motion
from codec.cuer.voice import Voice, load_voice
from codec.cues.language import french
from codec.errors import CueError
from cuecast.practice.doubles import doubles
from cuecast.practice.items import lips_only, pair_items, phrase_starts, text_item
from cuecast.practice.papers import consent_of
from cuecast.practice.session import Answer, TrialSession, new_session, old_session
from cuecast.practice.trial import Trial
from receiver.reception.events import MotionPiece
from receiver.television.protocol import pack_motion
from receiver.television.server import TelevisionChannel, page_files

PAGE = Path(__file__).parent / "page"

_KEPT = 32
"""Items of a learner that stay in memory."""

_QUESTIONS = 10
"""Questions of a quiz."""

_MOST_SEED = 1 << 32
"""Seeds of quizzes are below this."""


def packed(motion: Motion) -> bytes:
    """Return a motion as the page reads it (`receiver.television.protocol`)."""
    return pack_motion(MotionPiece(motion.start_s, motion.rate_hz, motion.params, ("L0", "L1")))


class _Pages(TelevisionChannel):
    """A page of practice with the scripts and the voice of the television's."""

    def __init__(self, voice: Voice, index: str, *, host: str, port: int) -> None:
        super().__init__(voice, live=False, host=host, port=port)
        own = page_files(PAGE)
        self._fixed |= own | {"/": own[f"/page/{index}"]}
        self._own_voice = voice

    async def _tell(self, socket: web.WebSocketResponse) -> None:
        """Close: there is no programme."""
        await socket.close()

    def _binary(self, motion: Motion, *, hand: bool) -> web.Response:
        shown = motion if hand else lips_only(motion, self._own_voice)
        return web.Response(body=packed(shown), content_type="application/octet-stream")


def _refusal(error: CueError) -> web.Response:
    return web.json_response({"error": str(error)}, status=400)


class LearnerPages(_Pages):
    """The learner's page: any sentence, labial doubles, keys, a sheet to print."""

    def __init__(self, voice: Voice, *, host: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(voice, "learn.html", host=host, port=port)
        self._items: OrderedDict[str, Motion] = OrderedDict()
        self._turn = asyncio.Lock()

    def _routes(self) -> list[web.RouteDef]:
        return [
            web.get("/item.json", self._item),
            web.get("/item.bin", self._motion),
            web.get("/doubles.json", self._doubles),
            web.get("/chart.json", self._chart),
        ]

    async def _made(self, request: web.Request) -> Motion:
        """Return the motion that a request names: of ``text``, or as one of ``family``."""
        text = " ".join(request.query.get("text", "").split())
        family = request.query.get("family", "")
        name = f"{family}\n{text}"
        async with self._turn:  # one at a time: a text takes a second of processor
            if name not in self._items:
                self._items[name] = await asyncio.to_thread(self._make, text, family)
            self._items.move_to_end(name)
            while len(self._items) > _KEPT:
                self._items.popitem(last=False)
            return self._items[name]

    def _make(self, text: str, family: str) -> Motion:
        if not family:
            return text_item(text, self._own_voice)
        words = next((words for words in doubles() if family == words[0]), ())
        if text not in words:
            raise CueError(f"{text[:40]!r} n’est pas un des sosies de {family[:40]!r}")
        return pair_items(words, self._own_voice)[words.index(text)]

    async def _item(self, request: web.Request) -> web.Response:
        try:
            motion = await self._made(request)
        except CueError as error:
            return _refusal(error)
        assert motion.score is not None
        return web.json_response(
            {
                "keys": [key.as_dict() for key in motion.score.keys],
                "phrases": phrase_starts(motion.score),
                "duration_s": motion.duration_s,
            }
        )

    async def _motion(self, request: web.Request) -> web.Response:
        try:
            motion = await self._made(request)
        except CueError as error:
            return _refusal(error)
        return self._binary(motion, hand=request.query.get("hand") != "0")

    async def _doubles(self, request: web.Request) -> web.Response:
        """Return a quiz: families in random order and the word that each shows."""
        try:
            rng = np.random.default_rng(_seed(request))
        except CueError as error:
            return _refusal(error)
        families = doubles()
        chosen = rng.permutation(len(families))[:_QUESTIONS]
        return web.json_response(
            [{"words": families[i], "right": int(rng.integers(len(families[i])))} for i in chosen]
        )

    async def _chart(self, request: web.Request) -> web.Response:
        return web.json_response(chart())


def chart() -> dict[str, Any]:
    """Return the chart of French: phones of each hand shape and of each placement.

    Examples
    --------
    >>> chart()["shapes"]["1"], chart()["placements"]["throat"]
    (['p', 'd', 'ʒ'], ['e', 'y', 'œ̃'])
    """
    language = french()
    shapes: dict[str, list[str]] = {}
    for phone, shape in language.shapes.items():
        shapes.setdefault(str(shape), []).append(phone)
    placements: dict[str, list[str]] = {}
    for phone, place in sorted(
        language.placement_of.items(), key=lambda pair: language.phones.index(pair[0])
    ):
        placements.setdefault(place, []).append(phone)
    return {"shapes": shapes, "placements": placements}


def _seed(request: web.Request) -> int:
    text = request.query.get("seed", "0")
    if not text.isdecimal() or len(text) > 10 or int(text) >= _MOST_SEED:
        raise CueError(f"seed {text[:20]!r} is not a number from 0 to {_MOST_SEED - 1}")
    return int(text)


class TrialPages(_Pages):
    """The participant's page of a prepared test."""

    def __init__(self, trial: Trial, *, host: str = "127.0.0.1", port: int = 0) -> None:
        super().__init__(load_voice(trial.voice), "trial.html", host=host, port=port)
        self._trial = trial
        self._consent = consent_of(trial)
        self._sessions: dict[str, TrialSession] = {}

    def _routes(self) -> list[web.RouteDef]:
        return [
            web.get("/trial.json", self._about),
            web.post("/start", self._start),
            web.post("/answer", self._answer),
            web.get("/step.json", self._step),
            web.get("/step.bin", self._motion),
            web.get("/sound", self._sound),
        ]

    async def _about(self, request: web.Request) -> web.Response:
        return web.json_response({"kind": self._trial.kind, "consent": self._consent})

    async def _start(self, request: web.Request) -> web.Response:
        try:
            asked = await _document(request)
            if asked.get("consent") is not True:
                raise CueError("sans accord, le test ne commence pas")
            code = str(asked.get("code") or "")
            session = old_session(self._trial, code) if code else new_session(self._trial)
        except CueError as error:
            return _refusal(error)
        self._sessions[session.code] = session
        return web.json_response(_progress(session))

    async def _answer(self, request: web.Request) -> web.Response:
        try:
            given = await _document(request)
            session = self._session(str(given.get("code")))
            try:
                answer = Answer(
                    int(given["choice"]),
                    float(given["answer_ms"]),
                    float(given["frames_per_second"]),
                )
                step = int(given["step"])
            except (KeyError, TypeError, ValueError, OverflowError) as error:
                raise CueError(f"réponse mal formée : {error!r}") from error
            session.answer(step, answer)
        except CueError as error:
            return _refusal(error)
        return web.json_response(_progress(session))

    async def _step(self, request: web.Request) -> web.Response:
        """Return what the screen of the participant's next step needs; the answer stays here."""
        try:
            session = self._session(request.query.get("code", ""))
            if session.ended:
                raise CueError("le test est terminé")
        except CueError as error:
            return _refusal(error)
        step = session.steps[session.next]
        return web.json_response(
            {
                "step": session.next,
                "prompt": step.prompt,
                "choices": step.choices,
                "display": step.condition.display,
                "moves": bool(step.motion),
                "sound": bool(step.sound),
                "captions": step.captions,
            }
        )

    async def _motion(self, request: web.Request) -> web.Response:
        try:
            session = self._session(request.query.get("code", ""))
            if session.ended or not session.steps[session.next].motion:
                raise CueError("rien à montrer")
            step = session.steps[session.next]
            motion = await asyncio.to_thread(load_motion, self._trial.folder / step.motion)
            self._own_voice.check_motion(motion)
        except CueError as error:
            return _refusal(error)
        return self._binary(motion, hand=step.condition.hand != "lips")

    async def _sound(self, request: web.Request) -> web.StreamResponse:
        try:
            session = self._session(request.query.get("code", ""))
        except CueError as error:
            return _refusal(error)
        step = None if session.ended else session.steps[session.next]
        path = self._trial.folder / step.sound if step is not None and step.sound else None
        if path is None or not path.is_file():
            raise web.HTTPNotFound(text="no sound here")
        kind = mimetypes.guess_type(path.name)[0] or "audio/wav"
        return web.FileResponse(path, headers={"Content-Type": kind})

    def _session(self, code: str) -> TrialSession:
        session = self._sessions.get(code)
        if session is None:
            raise CueError(f"le participant {code[:20]!r} n’a pas commencé")
        return session


def _progress(session: TrialSession) -> dict[str, Any]:
    return {
        "code": session.code,
        "next": session.next,
        "steps": len(session.steps),
        "ended": session.ended,
    }


async def _document(request: web.Request) -> dict[str, Any]:
    try:
        found = json.loads(await request.text())
    except (ValueError, RecursionError) as error:
        raise CueError("demande mal formée") from error
    if not isinstance(found, dict):
        raise CueError("demande mal formée")
    return found


def serve_pages(pages: _Pages, on_ready: Callable[[str], None]) -> None:
    """Serve until interrupted (Ctrl-C).

    Parameters
    ----------
    pages : LearnerPages or TrialPages
    on_ready : callable
        Gets the address.

    Raises
    ------
    CueError
        If the port is not free.
    """

    async def run() -> None:
        async with pages.running() as address:
            on_ready(address)
            await asyncio.Event().wait()

    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(run())
