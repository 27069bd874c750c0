"""Sound and picture together: superframes that neither carrier has alone."""

from dataclasses import replace

import numpy as np
import pytest

from codec.errors import CueError
from watermark.audio.profile import PROFILES as AUDIO_PROFILES
from watermark.link.combine import Combiner
from watermark.link.link import Link, Rates
from watermark.link.superframe import ReceivedSuperframe
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
    # Required: each alone loses over 20 %, together under 2 %. Here 77 % and 40 % of 60.
    rng = np.random.default_rng(1)
    combiner = Combiner()
    lost = [0, 0, 0]
    for k in range(60):
        l0 = rng.bytes(AUDIO.l0_bytes)
        heard = through_noise(AUDIO, l0, 2.3, 0.64 * k + 0.01, rng)
        seen = through_noise(VIDEO, l0, 3.8, 0.64 * k, rng)
        told = combiner.add("audio", heard, AUDIO) + combiner.add("video", seen, VIDEO)
        got = [s.l0 for s in told if s.l0 is not None]
        assert all(found == l0 for found in got)
        lost[0] += heard.l0 is None
        lost[1] += seen.l0 is None
        lost[2] += not got
    assert lost[0] > 12
    assert lost[1] > 12
    assert lost[2] == 0
    assert combiner.recovered > 4


def test_the_twin_must_be_at_the_same_place() -> None:
    rng = np.random.default_rng(2)
    combiner = Combiner()
    l0 = bytes(AUDIO.l0_bytes)
    seen = through_noise(VIDEO, l0, 6.0, 0.0, rng)
    assert [s.l0 for s in combiner.add("video", seen, VIDEO)] == [None]
    heard = through_noise(AUDIO, l0, 3.0, 0.64, rng)
    assert heard.l0 is None
    assert combiner.add("audio", heard, AUDIO) == []
    # 0.3 s is no place of the sound's grid: such pictures belong to something else.
    assert combiner.add("video", replace(seen, position_s=0.94), VIDEO) == []
    assert combiner.add("video", replace(seen, position_s=1.3), VIDEO) == []
    assert combiner.recovered == 0


def test_the_sound_says_where() -> None:
    combiner = Combiner()
    heard = ReceivedSuperframe(b"a", b"", 0.64, 1.0)
    assert combiner.add("audio", heard, None) == [heard]
    (seen,) = combiner.add("video", ReceivedSuperframe(b"a", b"bc", 1.4, 1.0), None)
    assert seen.position_s == pytest.approx(1.28)
    late = ReceivedSuperframe(b"a", b"bc", 9.0, 1.0)
    assert combiner.add("video", late, None) == [late]


def test_a_failure_is_told_once_and_only_if_nobody_has_it() -> None:
    rng = np.random.default_rng(4)
    noise = [through_noise(AUDIO, bytes(20), 9.0, 0.64 * k, rng) for k in range(4)]
    whole = [ReceivedSuperframe(bytes(20), b"", 0.64 * k, 1.0) for k in range(4)]
    combiner = Combiner()
    # Alone, a carrier's failures are told at once.
    assert combiner.add("audio", noise[0], AUDIO) == [noise[0]]
    assert combiner.add("video", whole[0], VIDEO) == [whole[0]]
    # Beside another one, they wait for it.
    assert combiner.add("audio", noise[1], AUDIO) == []
    assert combiner.add("video", whole[1], VIDEO) == [whole[1]]
    assert combiner.add("video", replace(noise[2], ratios=None), VIDEO) == []
    told = combiner.add("audio", noise[2], AUDIO)
    assert [s.l0 for s in told] == [None]
    assert [s.l0 for s in combiner.add("video", whole[3], VIDEO)] == [bytes(20)]
    assert combiner.add("audio", noise[3], AUDIO) == []


def test_other_codes_pass_by() -> None:
    rng = np.random.default_rng(3)
    combiner = Combiner()
    robust = AUDIO_PROFILES["robust"]
    seen = through_noise(VIDEO, bytes(VIDEO.l0_bytes), 20.0, 0.0, rng)
    heard = through_noise(robust, bytes(robust.l0_bytes), 9.0, 0.0, rng)
    assert combiner.add("video", seen, VIDEO) == [seen]
    assert combiner.add("audio", heard, robust) == []
    assert combiner.recovered == 0
    with pytest.raises(CueError, match="carrier 'smell': must be one of audio, video, a335"):
        combiner.add("smell", heard, AUDIO)
