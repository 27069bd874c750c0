"""Sound as spec/hearing.md hears it: vectors against the receiver, the procedure against both."""

import json
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from spec.reference.hearing import hear
from spec.reference.hearing_view import converted
from tests.spec.hearing_record import record
from watermark.audio.follow.align import read_view
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.profile import PROFILES
from watermark.audio.signal.sample_buffer import StereoBuffer

ROOT = Path(__file__).parents[2]
VECTORS = ROOT / "spec" / "vectors"
DOCUMENT = json.loads((VECTORS / "hearing.json").read_text(encoding="utf-8"))
CASES = {case["id"]: case for case in DOCUMENT["cases"]}
ALLOWED_FEWER = 1
"""Superframes of 42 (A17)."""


def sound_of(case: dict[str, Any]) -> tuple[NDArray[np.float64], int]:
    """Return the sound of a case, shape (channels, n), and its rate."""
    samples, rate = soundfile.read(VECTORS / case["file"], always_2d=True)
    return samples.T, rate


@pytest.mark.vectors("hearing")
def test_soft_values_are_the_receiver_s(case: dict[str, Any]) -> None:
    sound, rate = sound_of(case)
    assert rate == case["rate"]
    channels = [converted(channel, rate) for channel in sound]
    tape = StereoBuffer()
    left, right = channels[0], channels[-1]
    tape.append_pair((left + right) / 2, (left - right) / 2)
    demodulator = Demodulator(PROFILES[case["profile"]], case["key"])
    step = demodulator.profile.step(case["level"])
    for field, places in (("soft", demodulator.places), ("soft_mid", None)):
        if field in case:
            view = read_view(tape, case["start"], 1.0, make_masker(), places)
            found = demodulator.layout.gather(view.soft(demodulator.layout.cells, step))
            stated = np.frombuffer(bytes.fromhex(case[field]), dtype=np.int8) / DOCUMENT["parts"]
            assert np.mean(np.abs(found - stated) <= case["tolerance"]) >= case["share"]


def payloads_heard(case: dict[str, Any], most: int) -> list[tuple[str, str]]:
    sound, rate = sound_of(case)
    return [(one.l0.hex(), (one.l1 or b"").hex()) for one in islice(hear(sound, rate), most)]


def test_the_procedure_acquires_and_follows() -> None:
    found = payloads_heard(CASES["acquisition"], 3)
    assert len(found) == 3
    assert found[1] == (CASES["acquisition"]["l0"], CASES["acquisition"]["l1"])


@pytest.mark.slow
@pytest.mark.vectors("hearing")
def test_the_procedure_hears_every_vector(case: dict[str, Any]) -> None:
    assert (case["l0"], case["l1"]) in payloads_heard(case, 3)


@pytest.mark.slow
def test_the_procedure_hears_as_much_as_the_receiver() -> None:
    for name, row in record(None).items():
        assert row["hearing"] >= row["receive"] - ALLOWED_FEWER, (name, row)
        assert row["wrong"] == 0
