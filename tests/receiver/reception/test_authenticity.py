"""Whose cues are received: told, and drawn only if they are verified where that is wanted."""

import asyncio
import itertools
import json
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from functools import cache
from io import BytesIO

import numpy as np
import pytest
from numpy.typing import NDArray

from codec.authentication.signer import Signer
from codec.cuer.voice import load_voice
from codec.cues.score import Key
from codec.superframe.checks import proved, with_proof
from codec.superframe.encoder import SuperframeEncoder
from codec.superframe.superframe import Superframe
from receiver.live.broadcast import MediaFragment
from receiver.live.server import LiveTelevision
from receiver.reception.authenticity import Gate, Passed, Trust
from receiver.reception.engine import Receiver
from receiver.reception.events import AuthenticityChanged, Event, KeysFound
from tests.codec.authentication.test_authentication import BEGIN_S, announced, key
from tests.codec.quick_search import quick_search
from tests.receiver.standin import make_motion
from watermark.audio.embed.embedder import AudioEmbedder
from watermark.audio.signal.profile import STANDARD

VOICE = load_voice()
COUNT = 48
MOTION = make_motion(VOICE, duration_s=0.64 * (COUNT + 4))
FIRST_S = 0.31


@pytest.fixture(autouse=True)
def quick() -> Iterator[None]:
    """Find hidden bits without trying all: the tests of signing and the command line try them."""
    with quick_search(key(), announced().periods):
        yield


@cache
def encoded(*, signed: bool) -> list[Superframe]:
    encoder = SuperframeEncoder(
        VOICE, l0_bytes=STANDARD.l0_bytes, l1_bytes=STANDARD.l1_bytes, protected=True, signed=signed
    )
    return [encoder.encode(MOTION, k + 2) for k in range(COUNT)]


def superframes(*, number: int | None = 0, on_air_s: float = BEGIN_S) -> list[tuple[bytes, bytes]]:
    """Return a signed programme; unsigned without a number of its key."""
    sent = encoded(signed=number is not None)
    if number is None:
        return [(s.l0, s.l1) for s in sent]
    signer = Signer(key(number), on_air_s, 9)
    return [(with_proof(s.l0, signer.take(proved(s.l0))), s.l1) for s in sent]


@cache
def genuine() -> list[tuple[bytes, bytes]]:
    return superframes()


def through(
    gate: Gate, sent: Iterable[tuple[bytes | None, bytes | None]], begin_s: float = FIRST_S
) -> tuple[list[Passed], list[Event]]:
    passed, events = [], []
    for k, (l0, l1) in enumerate(sent):
        out, told = gate.take(l0, l1, begin_s + 0.64 * k)
        passed += out
        events += told
    return passed + gate.finish(), events


def test_a_genuine_programme_passes_and_is_told() -> None:
    gate = Gate(Trust(announced(), clock=BEGIN_S.__add__))
    passed, events = through(gate, genuine())
    assert [p.l0 for p in passed] == [l0 for l0, _ in genuine()]
    assert [(e.status, e.of) for e in events if isinstance(e, AuthenticityChanged)] == [
        ("verified", "channel 0")
    ]
    told = gate.summary()
    assert told["status"] == "verified"
    assert told["verified_s"] - FIRST_S <= 15.4
    assert told["age_s"] == pytest.approx(FIRST_S, abs=0.4)
    assert told["superframes"]["verified"] >= COUNT - 32
    assert told["downgraded_s"] is None
    assert told["holds"] == announced().span
    assert told["superframes"]["forged"] == 0
    assert told["on_air"].startswith("2026-10-2")


def test_only_verified_ones_pass_where_that_is_wanted() -> None:
    gate = Gate(Trust(announced(), only_verified=True))
    passed, _ = through(gate, genuine())
    whole = COUNT - 32
    assert [p.l0 for p in passed[:whole]] == [l0 for l0, _ in genuine()[:whole]]
    assert {p.l0 for p in passed} <= {l0 for l0, _ in genuine()}
    assert all(p.l1 is None for p in passed)


@pytest.mark.parametrize("number", [None, 1])
def test_nothing_of_others_passes(number: int | None) -> None:
    gate = Gate(Trust(announced(), only_verified=True))
    passed, _ = through(gate, superframes(number=number))
    assert passed == []
    assert gate.summary()["status"] == ("unsigned" if number is None else "unknown")


def test_a_forger_in_between_is_told_and_left_out() -> None:
    forged = [
        *genuine()[:30],
        *((with_proof(genuine()[9][0], k % 512), b"") for k in range(2)),
        *genuine()[32:],
    ]
    gate = Gate(Trust(announced(), only_verified=True, clock=BEGIN_S.__add__))
    passed, events = through(gate, forged)
    assert "forged" in [e.status for e in events if isinstance(e, AuthenticityChanged)]
    assert not {forged[30][0], forged[31][0]} & {p.l0 for p in passed}
    assert {p.l0 for p in passed} <= {l0 for l0, _ in genuine()}


def test_a_replay_in_a_recording_is_told() -> None:
    later = superframes(on_air_s=BEGIN_S + 7200)
    gate = Gate(Trust(announced(), only_verified=True, tolerance_s=5.0))
    first, _ = through(gate, genuine()[:40])
    second, events = through(gate, later, FIRST_S + 0.64 * 40 + 0.3)
    assert len(first) > 0
    assert second == []
    assert gate.summary()["reason"].startswith("from another time")
    assert [e.status for e in events if isinstance(e, AuthenticityChanged)] == ["forged"]


def test_losses_and_splices_of_ones_own_stay_verified() -> None:
    rng = np.random.default_rng(2)
    lossy = [(None, None) if rng.random() < 0.04 else s for s in genuine()]
    gate = Gate(Trust(announced()))
    through(gate, lossy)
    told = gate.summary()
    assert told["superframes"]["forged"] == 0
    assert told["status"] == "verified"


def marked(sent: list[tuple[bytes, bytes]]) -> NDArray[np.float32]:
    rng = np.random.default_rng(5)
    host = (0.05 * rng.normal(0, 1, (round(48000 * 0.64 * (COUNT + 1)), 1))).astype(np.float32)
    embedder = AudioEmbedder(48000, 1, lambda k: sent[min(k, COUNT - 1)])
    return np.concatenate([embedder.process(host), embedder.flush()])


def heard(sound: NDArray[np.float32], trust: Trust | None) -> tuple[list[Key], Receiver]:
    receiver = Receiver(48000, 1, voice=VOICE, trust=trust)
    events = receiver.process(sound) + receiver.flush()
    final = [e.keys for e in events if isinstance(e, KeysFound) and e.final]
    return list(itertools.chain(*final)), receiver


def test_no_key_is_lost_to_it() -> None:
    """In sound: a signed programme tells the keys of an unsigned one, and whose they are."""
    plain, receiver = heard(marked(superframes(number=None)), None)
    assert receiver.summary()["authenticity"] is None
    sound = marked(genuine())
    keys, receiver = heard(sound, Trust(announced()))
    assert [(k.shape, k.placement) for k in keys] == [(k.shape, k.placement) for k in plain]
    told = receiver.summary()
    assert told["authenticity"]["status"] == "verified"
    assert told["superframes"]["lost"] == 0
    strict, receiver = heard(sound, Trust(announced(), only_verified=True))
    places = [(k.shape, k.placement) for k in keys]
    most = round(0.5 * len(keys))
    assert [(k.shape, k.placement) for k in strict][:most] == places[:most]


def test_a_broadcast_is_held_back_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page gets the media later by as much as verifying takes; who speaks is told at once."""
    television = LiveTelevision(BytesIO(), VOICE, hold_s=0.3)
    sent: list[tuple[str, str | bytes]] = []
    monkeypatch.setattr(television, "_send", lambda kind, message: sent.append((kind, message)))

    async def main() -> None:
        television._loop = asyncio.get_running_loop()
        television.publish(MediaFragment(b"media"))
        television.publish(AuthenticityChanged(1.0, "verified", "channel 0"))
        assert [kind for kind, _ in sent] == ["feed"]
        await asyncio.sleep(0.6)
        assert sent[1] == ("media", b"media")

    asyncio.run(main())
    told = json.loads(sent[0][1])
    assert told == {
        "type": "authenticity",
        "time_s": 1.0,
        "status": "verified",
        "of": "channel 0",
        "reason": "",
        "age_s": None,
    }


@pytest.mark.parametrize(("late_s", "status"), [(2.0, "verified"), (600.0, "forged")])
def test_a_broadcast_knows_the_time(late_s: float, status: str) -> None:
    """Live: the keys' time has to be that of the clock."""
    gate = Gate(Trust(announced(), clock=lambda position_s: BEGIN_S + late_s + position_s))
    _, events = through(gate, genuine()[:40])
    assert gate.summary()["status"] == status
    (told,) = [e for e in events if isinstance(e, AuthenticityChanged)]
    assert told.age_s == pytest.approx(late_s + FIRST_S, abs=0.4)


def test_unsigned_cues_in_place_of_signed_ones_are_reported() -> None:
    """Within four superframes; and signed ones again, within a block."""
    unsigned = superframes(number=None)
    sent = [*genuine()[:34], *unsigned[34:44], *genuine()[44:]]
    gate = Gate(Trust(announced(), clock=BEGIN_S.__add__))
    _, events = through(gate, sent)
    told = [e for e in events if isinstance(e, AuthenticityChanged)]
    assert [e.status for e in told][:2] == ["verified", "unsigned"]
    assert told[1].time_s == pytest.approx(FIRST_S + 38 * 0.64)
    assert told[1].reason == "signed cues were replaced by unsigned ones"
    assert gate.summary()["downgraded_s"] == pytest.approx(FIRST_S + 34 * 0.64)
    assert [e.status for e in told][2] != "unsigned"


@pytest.mark.parametrize("days", [-40.0, 400.0])
def test_a_key_file_of_another_time_is_answered_with_dates(days: float) -> None:
    at_s = BEGIN_S + days * 86400
    gate = Gate(Trust(announced(), clock=lambda position_s: at_s + position_s))
    _, events = through(gate, superframes(on_air_s=at_s)[:20])
    (told,) = [e for e in events if isinstance(e, AuthenticityChanged)]
    assert told.status == "unknown"
    date = datetime.fromtimestamp(at_s, UTC).isoformat(timespec="minutes")[:10]
    assert told.reason.startswith(f"the key file holds {announced().span}, not at {date}")
