"""Sound and picture together: superframes that neither carrier has alone."""

from dataclasses import replace

import numpy as np
import pytest

from codec.errors import CueError
from watermark.audio.signal.profile import PROFILES as AUDIO_PROFILES
from watermark.link.combine import Combiner, _CarrierSuperframe, _fold
from watermark.link.link import Link, Rates
from watermark.link.polar import make_code
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
    recovered = 0
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
        recovered += heard.l0 is None and seen.l0 is None and bool(got)
        assert combiner.recovered == recovered
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


@pytest.mark.parametrize("length", [5, 16, 17, 40])
def test_ratios_are_folded_onto_the_mother_code(length: int) -> None:
    code = make_code(5, max(length, 16), 16)
    ratios = np.linspace(-30, 30, length)
    seen = _CarrierSuperframe("audio", ReceivedSuperframe(None, None, 0.0, 0.0, 0.0, ratios), None)
    expected = np.zeros(16)
    for place, ratio in enumerate(ratios):
        expected[place % 16] += min(max(ratio, -20.0), 20.0)
    np.testing.assert_allclose(_fold(seen, code), expected)
    silent = _CarrierSuperframe("audio", ReceivedSuperframe(None, None, 0.0, 0.0), None)
    assert _fold(silent, code).tolist() == [0.0] * 16


def failed(position_s: float) -> ReceivedSuperframe:
    return ReceivedSuperframe(None, None, position_s, 0.1)


def whole(position_s: float, l0: bytes = b"x") -> ReceivedSuperframe:
    return ReceivedSuperframe(l0, b"", position_s, 0.9)


@pytest.mark.parametrize(("silent_s", "alone"), [(1.99, False), (2.01, True)])
def test_how_long_a_carrier_counts(silent_s: float, alone: bool) -> None:
    combiner = Combiner()
    assert combiner.add("video", whole(0.0), None) == [whole(0.0)]
    told = combiner.add("audio", failed(silent_s), None)
    assert told == ([failed(silent_s)] if alone else [])


@pytest.mark.parametrize(("off_s", "same"), [(0.19, True), (0.21, False)])
def test_how_far_twins_may_be_apart(off_s: float, same: bool) -> None:
    """What another carrier had already is told no more; elsewhere a failure waits."""
    combiner = Combiner()
    combiner.add("video", whole(0.0), None)
    combiner.add("video", whole(0.64), None)
    assert combiner.add("audio", failed(0.64 + off_s), None) == []
    later = combiner.add("audio", failed(0.64 + off_s), None)
    assert later == []
    assert (len(combiner._waiting) == 0) is same


@pytest.mark.parametrize(("off_s", "told"), [(0.19, True), (-0.19, True), (0.21, False)])
def test_the_leading_carrier_s_grid_counts(off_s: float, told: bool) -> None:
    combiner = Combiner()
    combiner.add("audio", whole(10.0), None)
    found = combiner.add("video", whole(10.64 + off_s), None)
    assert [s.position_s for s in found] == ([pytest.approx(10.64)] if told else [])
    # Two seconds after the sound's last superframe the picture has a grid of its own.
    found = combiner.add("video", whole(12.05), None)
    assert [s.position_s for s in found] == [pytest.approx(12.05)]
    back = combiner.add("video", whole(9.36 + 0.1), None)
    assert [s.position_s for s in back] == [pytest.approx(9.36)]


def test_a_failure_waits_no_longer_than_its_twin_may_come() -> None:
    combiner = Combiner()
    combiner.add("video", whole(0.0), None)
    assert combiner.add("audio", failed(0.64), None) == []
    combiner.add("video", whole(2.7), None)
    assert combiner._waiting == []


def test_the_surer_of_both_speaks_and_the_richer_one_s_second_class() -> None:
    rng = np.random.default_rng(1)
    l0 = bytes(range(AUDIO.l0_bytes))
    sent: list[tuple[Rates, bytes, float]] = [
        (AUDIO, bytes(range(100, 100 + AUDIO.l1_bytes)), 2.6),
        (VIDEO, bytes(range(50, 50 + VIDEO.l1_bytes)), 3.9),
    ]
    for order in (0, 1):
        for _ in range(20):
            pair: list[ReceivedSuperframe] = []
            for profile, l1, sigma in sent:
                signal = 1.0 - 2.0 * Link(profile).encode(l0, l1)
                ratios = 2 * (signal + rng.normal(0, sigma, signal.size)) / sigma**2
                cut = profile.l0_coded
                ratios[cut:] = 8 * signal[cut:]
                pair.append(ReceivedSuperframe(None, None, 0.0, 0.2 + 0.1 * len(pair), 0.3, ratios))
            combiner = Combiner()
            names = ["audio", "video"]
            first, second = (order, 1 - order)
            combiner.add(names[second], whole(-0.64), None)
            combiner.add(names[first], pair[first], sent[first][0])
            told = combiner.add(names[second], pair[second], sent[second][0])
            if told and told[0].l0 is not None:
                break
        else:
            pytest.fail("never recovered")
        richest = max((sent[second], sent[first]), key=lambda one: one[0].l1_bytes)
        assert told[0].l0 == l0
        assert told[0].l1 == richest[1]
        assert told[0].confidence == pytest.approx(0.3)


def test_superframes_of_other_sizes_are_put_together() -> None:
    rng, l0 = np.random.default_rng(3), bytes(range(17))
    audio, video = (replace(profile, l0_bytes=17) for profile in (AUDIO, VIDEO))
    combiner, recovered = Combiner(), 0
    for k in range(12):
        heard = through_noise(audio, l0, 2.8, 0.64 * k, rng)
        seen = through_noise(video, l0, 4.6, 0.64 * k, rng)
        told = combiner.add("audio", heard, audio) + combiner.add("video", seen, video)
        got = [s.l0 for s in told if s.l0 is not None]
        assert all(found == l0 for found in got)
        recovered += heard.l0 is None and seen.l0 is None and bool(got)
    assert combiner.recovered == recovered > 2


def test_codes_of_other_mothers_are_not_put_together() -> None:
    rng, l0 = np.random.default_rng(4), bytes(range(20))
    audio = replace(AUDIO, l0_coded=300)
    assert audio.l0_mother != VIDEO.l0_mother
    combiner = Combiner()
    for position_s, sigma in ((0.0, 0.5), (0.64, 30.0)):
        heard, seen = (through_noise(p, l0, sigma, position_s, rng) for p in (audio, VIDEO))
        told = combiner.add("audio", heard, audio) + combiner.add("video", seen, VIDEO)
        assert [s.l0 for s in told] == ([l0, l0] if sigma < 1 else [None])
