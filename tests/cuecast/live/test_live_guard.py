"""Who may send live text, how fast, and what is answered to the others."""

import asyncio
import json
from contextlib import closing
from pathlib import Path

import aiohttp
import pytest

from codec.errors import CueError
from cuecast.live.guard import CAPTIONS_AT_ONCE, Guard, RateLimit, read_token
from cuecast.live.readiness import Announcer, Condition, Observation, condition_of
from cuecast.live.server import PlayoutServer

TOKEN = "0123456789abcdef"


class Listener:
    """What the server needs of a playout."""

    condition = Condition("ready", "no input")

    def __init__(self) -> None:
        self.captions: list[tuple[bytes, str]] = []
        self.refused: list[str] = []
        self._limit = RateLimit(0.0, CAPTIONS_AT_ONCE, lambda: 0.0)

    def caption(self, line: bytes, source: str) -> None:
        if not self._limit.allows():
            self.refuse(source, "too many")
            raise CueError("live text: too many")
        self.captions.append((line, source))

    def refuse(self, source: str, why: str) -> None:
        self.refused.append(why)

    def prometheus(self) -> str:
        return ""


async def send(port: int, *messages: str, **headers: str) -> tuple[int, list[str]]:
    """Send messages; return the status of the upgrade or the code of closing, and the answers."""
    answers = []
    async with aiohttp.ClientSession() as session:
        try:
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            line = await session.ws_connect(f"http://127.0.0.1:{port}/captions", headers=named)
        except aiohttp.WSServerHandshakeError as error:
            return error.status, []
        for message in messages:
            if not line.closed:
                await line.send_str(message)
        while True:
            try:
                found = await line.receive(timeout=1.0)
            except TimeoutError:
                break
            if found.type != aiohttp.WSMsgType.TEXT:
                break
            answers.append(found.data)
        await line.close()
        return line.close_code or 0, answers


def served(guard: Guard, *messages: str, **headers: str) -> tuple[Listener, int, list[str]]:
    listener = Listener()
    with closing(PlayoutServer(listener, 0, lambda line: None, guard)) as server:  # type: ignore[arg-type]
        code, answers = asyncio.run(send(server.port, *messages, **headers))
    return listener, code, answers


LINE = json.dumps({"text": "Bonsoir."})


def test_a_program_on_this_machine_speaks() -> None:
    listener, _, answers = served(Guard(), LINE)
    assert listener.captions == [(LINE.encode(), "127.0.0.1")]
    assert answers == []


@pytest.mark.parametrize(
    ("headers", "why"),
    [
        ({"Origin": "https://evil.example"}, "origin https://evil.example is not allowed"),
        ({"Origin": "null"}, "origin null is not allowed"),
        ({"Origin": "http://127.0.0.1:8080"}, "is not allowed"),
        ({"Host": "evil.example"}, "host 'evil.example' is not this machine"),
        ({"Host": "127.0.0.1.evil.example:80"}, "is not this machine"),
    ],
)
def test_a_page_does_not(headers: dict[str, str], why: str) -> None:
    listener, status, _ = served(Guard(), LINE, **headers)
    assert (status, listener.captions) == (403, [])
    assert why in listener.refused[0]


def test_a_page_that_is_allowed_does() -> None:
    guard = Guard(origins=("https://respeak.example",))
    assert served(guard, LINE, Origin="https://respeak.example")[0].captions
    assert not served(guard, LINE, Origin="https://respeak.example.evil.example")[0].captions


@pytest.mark.parametrize("given", ["", "Bearer wrong", f"Basic {TOKEN}", f"Bearer {TOKEN}x"])
def test_a_wrong_token(given: str) -> None:
    listener, status, _ = served(Guard(token=TOKEN), LINE, Authorization=given)
    assert (status, listener.captions) == (403, [])


def test_the_token_speaks_from_anywhere() -> None:
    headers = {"Authorization": f"Bearer {TOKEN}", "Host": "captions.example"}
    assert served(Guard("0.0.0.0", TOKEN), LINE, **headers)[0].captions
    with pytest.raises(CueError, match="needs --token-file"):
        Guard("0.0.0.0")


def test_a_flood_is_refused_and_ended() -> None:
    listener, code, answers = served(Guard(), *[LINE] * 400)
    assert len(listener.captions) == CAPTIONS_AT_ONCE
    assert json.loads(answers[0]) == {"error": "live text: too many"}
    assert code == 1008
    assert len(listener.refused) < 110


def test_a_line_of_a_megabyte_is_refused() -> None:
    listener, code, _ = served(Guard(), "x" * (1 << 20))
    assert (code, listener.captions) == (1009, [])
    assert "limit 16384 bytes" in listener.refused[0]


@pytest.mark.parametrize("content", ["", "short", "x" * 2000, "with\x00zero-in-the-mid"])
def test_tokens_that_are_none(tmp_path: Path, content: str) -> None:
    path = tmp_path / "token"
    path.write_text(content)
    with pytest.raises(CueError, match="a token has 16 to 1024 printable characters"):
        read_token(str(path))
    with pytest.raises(CueError, match="cannot be read"):
        read_token(str(tmp_path / "none"))


def test_token_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "token"
    path.write_text(f" {TOKEN}\n")
    assert read_token(str(path)) == TOKEN


def seen(**changes: bool | float) -> Observation:
    facts: dict[str, bool | float] = {
        "stopping": False, "input_silent": False, "loaded": True, "was_loaded": True,
        "marking": False, "sound": True, "waited_s": 0.0, "delay_s": 5.0,
    }  # fmt: skip
    return Observation(**(facts | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "state", "words"),
    [
        ({"loaded": False, "was_loaded": False}, "starting", "loading"),
        ({"loaded": False}, "bypass", "ended and is started again"),
        ({"input_silent": True}, "ready", "no input"),
        ({}, "ready", "within 5 s"),
        ({"marking": True}, "marked", ""),
        ({"waited_s": 6.0}, "bypass", "too slow"),
        ({"sound": False}, "bypass", "no sound that can be marked"),
        ({"stopping": True, "marking": True}, "stopping", "no more input"),
    ],
)
def test_states(changes: dict[str, bool | float], state: str, words: str) -> None:
    found = condition_of(seen(**changes))
    assert found.state == state
    assert words in found.reason
    assert found.can_mark == (state in ("ready", "marked"))


def test_fast_changes_are_summed_up_in_the_log() -> None:
    lines: list[str] = []
    now = [0.0]
    announcer = Announcer(lines.append, lambda: now[0])
    for n in range(100):
        now[0] = 0.1 * n
        announcer.observe(condition_of(seen(marking=n % 2 == 0, waited_s=9.0)))
    assert len(lines) <= 6
    assert announcer.changes_total == 100
    now[0] = 60.0
    announcer.observe(condition_of(seen(stopping=True)))
    assert lines[-1].startswith("state stopping: no more input is taken (")
    assert lines[-1].endswith("changes since the last line)")
