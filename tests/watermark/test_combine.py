"""Sound and picture together: superframes that neither carrier has alone."""

import numpy as np
import pytest

from codec.errors import CueError
from watermark.combine import Combiner
from watermark.link import Link, Rates
from watermark.profile import PROFILES as AUDIO_PROFILES
from watermark.received import ReceivedSuperframe
from watermark.video.profile import PROFILES as VIDEO_PROFILES

AUDIO, VIDEO = AUDIO_PROFILES["standard"], VIDEO_PROFILES["twin"]


def through_noise(
    profile: Rates, l0: bytes, sigma: float, position_s: float, rng: np.random.Generator
) -> ReceivedSuperframe:
    """A superframe as a receiver gives it, ratios as of Gaussian noise."""
    link = Link(profile)
    sent = 1.0 - 2.0 * link.encode(l0, bytes(profile.l1_bytes))
    ratios = 2 * (sent + rng.normal(0, sigma, sent.size)) / sigma**2
    decoded = link.decode(ratios)
    return ReceivedSuperframe(decoded.l0, decoded.l1, position_s, 0.3, 0.3, ratios)


def test_each_alone_loses_both_together_do_not() -> None:
    # Required: each alone loses over 20 %, together under 2 %. Here both lose most of 40.
    rng = np.random.default_rng(1)
    combiner = Combiner(offset_s=10.0)
    lost = [0, 0, 0]
    for k in range(40):
        l0 = rng.bytes(AUDIO.l0_bytes)
        heard = through_noise(AUDIO, l0, 2.55, 10 + 0.64 * k + 0.01, rng)
        seen = through_noise(VIDEO, l0, 2.55, 0.64 * k, rng)
        together = [
            combiner.add("audio", heard, AUDIO),
            combiner.add("video", seen, VIDEO),
        ]
        got = [s.l0 for s in (heard, seen, *together) if s is not None and s.l0 is not None]
        assert all(found == l0 for found in got)
        lost[0] += heard.l0 is None
        lost[1] += seen.l0 is None
        # What one carrier had alone reaches the viewer without the combiner.
        lost[2] += not got
    assert lost[0] > 8
    assert lost[1] > 8
    assert lost[2] == 0
    assert combiner.recovered > 4


def test_the_twin_must_be_at_the_same_place() -> None:
    rng = np.random.default_rng(2)
    combiner = Combiner()
    l0 = bytes(AUDIO.l0_bytes)
    heard = through_noise(AUDIO, l0, 3.0, 0.64, rng)
    assert heard.l0 is None
    assert combiner.add("audio", heard, AUDIO) is None
    for position_s in (0.0, 1.28):
        seen = through_noise(VIDEO, l0, 2.8, position_s, rng)
        assert combiner.add("video", seen, VIDEO) is None
    assert combiner.recovered == 0


def test_whole_superframes_and_other_codes_pass_by() -> None:
    rng = np.random.default_rng(3)
    combiner = Combiner()
    whole = through_noise(AUDIO, bytes(AUDIO.l0_bytes), 0.5, 0.0, rng)
    assert whole.l0 is not None
    assert combiner.add("audio", whole, AUDIO) is None
    robust = AUDIO_PROFILES["robust"]
    heard = through_noise(robust, bytes(robust.l0_bytes), 9.0, 0.0, rng)
    seen = through_noise(VIDEO, bytes(VIDEO.l0_bytes), 9.0, 0.0, rng)
    assert combiner.add("audio", heard, robust) is None
    assert combiner.add("video", seen, VIDEO) is None
    with pytest.raises(CueError, match="carrier 'smell': must be one of audio, video"):
        combiner.add("smell", whole, AUDIO)
