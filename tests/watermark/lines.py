"""Lines, payloads and vectors for the tests of the A/335 carrier."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.watermark.payloads import payloads
from watermark.a335.carrier import A335Embedder
from watermark.a335.line import RUN_IN
from watermark.a335.profile import PROFILES

VECTORS = json.loads(
    (Path(__file__).parents[2] / "spec" / "vectors" / "a335.json").read_text(encoding="utf-8")
)["cases"]


def vectors(section: str) -> list[dict[str, Any]]:
    return [case for case in VECTORS if case["section"] == section]


def payload_of(system: Any, seed: int = 1) -> bytes:
    return RUN_IN + np.random.default_rng(seed).bytes(system.payload_bytes - 2)


def source(name: str) -> Any:
    profile = PROFILES[name]
    return payloads(profile.l0_bytes, profile.l1_bytes)


def grey(height: int = 8, width: int = 1280) -> np.ndarray:
    return np.full((height, width), 120, dtype=np.uint8)


def one(embedder: A335Embedder, frame: np.ndarray) -> np.ndarray:
    (marked,) = embedder.process(frame)
    return marked
