"""Strengths chosen on a coder: the least that arrives, never a worse mark than without."""

from collections import deque
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from tests.watermark.pictures import HEIGHT, WIDTH, mark, picture, receive, source
from watermark.link.link import L0_CHECK
from watermark.video.coder_trial import TRIED, TrialFinding
from watermark.video.design import Design, Strength, Way
from watermark.video.embed import VideoEmbedder
from watermark.video.modes import make_modes
from watermark.video.profile import COLUMNS, DATA, PROFILES, ROWS, STEPS, TEMPLATES
from watermark.video.receive import VideoReceiver
from watermark.video.strength_choice import FIRST_PART, StrengthChoice, TriedChannel

FRAMES = 48


class Spoiler:
    """Add noise that stays for 16 frames, in blocks of 4 x 4 pixels; hand frames on later."""

    def __init__(self, deviation: float, delay: int = 0) -> None:
        self._deviation, self._delay = deviation, delay
        self._frames: deque[Any] = deque()
        self._count = 0

    def process(self, luma: np.ndarray) -> list[np.ndarray]:
        rng = np.random.default_rng([3, self._count // 16])
        blocks = rng.normal(0, self._deviation, (HEIGHT // 4, WIDTH // 4))
        self._count += 1
        noisy = np.clip(luma + blocks.repeat(4, axis=0).repeat(4, axis=1), 0, 255)
        self._frames.append(np.round(noisy).astype(np.uint8))
        return [self._frames.popleft()] if len(self._frames) > self._delay else []

    def flush(self) -> list[np.ndarray]:
        rest = list(self._frames)
        self._frames.clear()
        return rest


class Spared(Spoiler):
    """Spoil all but the left quarter of some frames."""

    def __init__(self, first: int = 0, end: int = 1000) -> None:
        super().__init__(30.0)
        self._spoilt = range(first, end)

    def process(self, luma: np.ndarray) -> list[np.ndarray]:
        spoilt = self._count in self._spoilt
        (out,) = super().process(luma)
        kept = WIDTH // 4 if spoilt else WIDTH
        out[:, :kept] = luma[:, :kept]
        return [out]


class Mixer:
    """Mix each frame with the ones before, as cleaners of noise do."""

    def __init__(self, kept: float) -> None:
        self._kept = kept
        self._mixed: np.ndarray | None = None

    def process(self, luma: np.ndarray) -> list[np.ndarray]:
        before = luma if self._mixed is None else self._mixed
        self._mixed = self._kept * before + (1 - self._kept) * luma
        return [np.round(self._mixed).astype(np.uint8)]

    def flush(self) -> list[np.ndarray]:
        return []


class Swallower:
    def process(self, luma: np.ndarray) -> list[np.ndarray]:
        return []

    def flush(self) -> list[np.ndarray]:
        return []


@lru_cache
def unmarked() -> list[np.ndarray]:
    return [picture(n) for n in range(FRAMES)]


@lru_cache
def fixed() -> tuple[list[np.ndarray], Any]:
    return marked_for()


def marked_for(*channels: TriedChannel, name: str = "standard") -> tuple[list[np.ndarray], Any]:
    embedder = VideoEmbedder(WIDTH, HEIGHT, 25, source(name), profile=name, channels=channels)
    return mark(unmarked(), embedder), embedder.report()


def whole(frames: list[np.ndarray], deviation: float) -> list[bool]:
    """Which of the superframes arrive whole behind other noise than the trial's."""
    spoiler = Spoiler(deviation)
    arrived = [out for frame in frames for out in spoiler.process(frame[::-1])]
    found = receive([frame[::-1] for frame in arrived], VideoReceiver(WIDTH, HEIGHT, 25))
    right = {round(s.position_s / 0.64) for s in found if s.l1 is not None}
    return [k in right for k in range(FRAMES // 16)]


def design(place: int, *, energies: tuple[float, float] = (8.0, 8.0)) -> Design:
    """A superframe of a picture with a textured half; energies of smooth and textured cells."""
    half = np.arange(COLUMNS) < COLUMNS // 2
    energy, texture = (np.tile(np.where(half, *pair), (ROWS, 1)) for pair in (energies, (1.0, 4.0)))
    bits = np.zeros(DATA, dtype=np.int64)
    return Design(place, np.zeros((TEMPLATES, ROWS, COLUMNS)), energy, texture, bits, bits)


def test_weak_mark_where_little_is_asked() -> None:
    plain, plain_report = fixed()
    weak, report = marked_for(TriedChannel(Spoiler(0.0)))
    assert report.psnr_db > plain_report.psnr_db + 1.5
    assert report.steps == (3, 0, 0)
    assert all(whole(weak, 0.0))
    assert len(weak) == len(plain)


def test_strong_mark_where_much_is_asked() -> None:
    deviation = 0.7
    plain, _ = fixed()
    strong, report = marked_for(TriedChannel(Spoiler(deviation)))
    assert report.steps[0] == 0
    assert sum(whole(strong, deviation)) > sum(whole(plain, deviation))


def test_widest_step_only_where_it_may_be_taken() -> None:
    _, report = marked_for(TriedChannel(Spoiler(0.7), widest=1))
    assert report.steps[2] == 0


def test_wider_steps_for_the_sake_of_another_channel() -> None:
    hopeless = TriedChannel(Spoiler(40.0), whole=False, widest=0)
    _, alone = marked_for(hopeless)
    _, both = marked_for(hopeless, TriedChannel(Spoiler(0.7), widest=1))
    assert alone.steps == (3, 0, 0)
    assert both.steps[0] < 3
    assert both.steps[2] == 0
    assert both.psnr_db < alone.psnr_db


def marked_at_a_price(deviation: float, **options: Any) -> tuple[list[np.ndarray], Any]:
    return marked_for(TriedChannel(Spoiler(0.0)), TriedChannel(Spoiler(deviation), **options))


def test_l1_behind_a_poor_coder_is_given_up_where_it_costs_more_than_its_price() -> None:
    _, spared = marked_at_a_price(0.5, whole=False, widest=1)
    _, wanted = marked_at_a_price(0.5)
    _, dear = marked_at_a_price(0.5, price=1.1)
    frames, cheap = marked_at_a_price(0.5, price=10.0)
    assert wanted.psnr_db < spared.psnr_db - 1.0
    assert dear == spared
    assert cheap == wanted
    assert all(whole(frames, 0.5))


def test_price_of_l1_that_would_not_arrive_is_not_paid() -> None:
    _, spared = marked_at_a_price(1.6, whole=False, widest=1)
    _, cheap = marked_at_a_price(1.6, price=10.0)
    assert cheap == spared


def test_worst_of_several_channels_counts() -> None:
    _, one = marked_for(TriedChannel(Spoiler(0.3)))
    _, both = marked_for(TriedChannel(Spoiler(0.0)), TriedChannel(Spoiler(0.3)))
    assert both == one


def test_delay_of_the_coder_changes_nothing() -> None:
    at_once, _ = marked_for(TriedChannel(Spoiler(0.2)))
    later, _ = marked_for(TriedChannel(Spoiler(0.2, delay=7)))
    assert all(np.array_equal(a, b) for a, b in zip(at_once, later, strict=True))


def test_a_rehearsal_strengthens_what_its_trial_promised_too_well() -> None:
    hard = 0.5
    _, promised = marked_for(TriedChannel(Spoiler(0.0)))
    marked, report = marked_for(TriedChannel(Spoiler(0.0), again=Spoiler(hard)))
    assert report.psnr_db < promised.psnr_db - 1
    assert all(whole(marked, hard))


def test_a_rehearsal_never_weakens(monkeypatch: pytest.MonkeyPatch) -> None:
    _, easy = marked_for(TriedChannel(Spoiler(0.5), again=Spoiler(0.0)))
    _, absent = marked_for(TriedChannel(Spoiler(0.5), again=Swallower()))
    _, tried = marked_for(TriedChannel(Spoiler(0.5)))
    assert absent == tried
    monkeypatch.setattr("watermark.video.strength_choice.MARGIN", 1.65 * FIRST_PART)
    monkeypatch.setattr("watermark.video.strength_choice.OPENING_MARGIN", 2.4 * FIRST_PART)
    assert easy == marked_for(TriedChannel(Spoiler(0.5)))[1]


@pytest.mark.parametrize(("measured", "lone"), [(2.0, False), (1.5, True)])
def test_l0_shares_where_its_rehearsal_arrived(measured: float, lone: bool) -> None:
    profile, need = PROFILES["standard"], (8 * 20 + L0_CHECK) / 2560
    wire = Spoiler(0.0)
    channels = [TriedChannel(wire, again=wire)]
    choice = StrengthChoice(profile, make_modes(profile, 0, 1.0), (720, 1280), channels)
    # L1 would not arrive; L0 has the part of its margin that is asked before a rehearsal.
    promised = np.full((2, 2, len(TRIED)), 2.3 * need)
    result = choice.result(design(3), [TrialFinding(np.array([0.5, 0.5]), promised)])
    rehearsed = choice.least_visible(result)
    assert not rehearsed.lone
    result.correct(rehearsed, [(measured * need, measured * need)])
    assert choice.least_visible(result).lone == lone


def chosen(smooth: float, textured: float) -> Strength:
    """Strength where moves leave information as their square in all cells alike."""
    profile = PROFILES["standard"]
    channels = [TriedChannel(Spoiler(0.0))]
    choice = StrengthChoice(profile, make_modes(profile, 0, 1.0), (720, 1280), channels)
    promised = [min(0.12 * (STEPS[rung] * share) ** 2, 0.95) for rung, share in TRIED]
    finding = TrialFinding(np.array([0.5, 0.5]), np.array([[promised] * 2] * 2))
    return choice.least_visible(choice.result(design(3, energies=(smooth, textured)), [finding]))


def test_moves_are_spared_where_they_cost_most() -> None:
    # Nine times as much in the coarse lattice, and up to four times that where only it has detail.
    alike, dear = chosen(1000.0, 1000.0), chosen(0.0, 1000.0)
    assert alike.rest.coarse < alike.rest.fine
    step = [STEPS[each.rung] for each in (alike, dear)]
    assert step[1] * dear.rest.fine >= step[0] * alike.rest.fine
    assert step[1] * dear.rest.coarse <= step[0] * alike.rest.coarse
    assert dear.rest.coarse == pytest.approx(0.3)


def test_a_plain_wall_has_its_price() -> None:
    walls, full = design(3, energies=(0.0, 0.0)).prices, design(3, energies=(1e9, 1e9)).prices
    assert walls == pytest.approx(0.25 * full)
    assert full == pytest.approx([0.5, 0.5])


def test_l0_that_misses_its_margin_is_not_moved_for_next_to_nothing() -> None:
    # L0 asks for 2.5 times its need, of which 1.6 are left at every strength.
    profile, need = PROFILES["standard"], (8 * 20 + L0_CHECK) / 2560
    channels = [TriedChannel(Spoiler(0.0), whole=False, lone=False)]
    choice = StrengthChoice(profile, make_modes(profile, 0, 1.0), (720, 1280), channels)
    left = np.array([[[0.0] * len(TRIED), [3.2 * need] * len(TRIED)]] * 2)
    result = choice.result(design(3), [TrialFinding(np.array([0.5, 0.5]), left)])
    least = choice.least_visible(result)
    # Smooth cells leave nothing, textured ones the same at any strength.
    assert (least.rung, least.first) == (0, Way(0.5, 0.3))


def test_delay_of_a_rehearsals_coder_changes_nothing() -> None:
    at_once, _ = marked_for(TriedChannel(Spoiler(0.2), again=Spoiler(0.3)))
    later, _ = marked_for(TriedChannel(Spoiler(0.2, delay=5), again=Spoiler(0.3, delay=11)))
    assert all(np.array_equal(a, b) for a, b in zip(at_once, later, strict=True))


def test_the_number_of_cores_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def marked() -> list[np.ndarray]:
        # The second channel has no rehearsal, and must wait for that of the first.
        first = TriedChannel(Spoiler(0.2), again=Spoiler(0.3, delay=9))
        return marked_for(first, TriedChannel(Spoiler(0.1, delay=3)))[0]

    monkeypatch.setattr("watermark.video.codec_loop.os.cpu_count", lambda: 4)
    many = marked()
    monkeypatch.setattr("watermark.video.codec_loop.os.cpu_count", lambda: None)
    assert all(np.array_equal(a, b) for a, b in zip(many, marked(), strict=True))


def test_l0_alone_needs_less() -> None:
    _, both = marked_for(TriedChannel(Spoiler(0.5)))
    _, first = marked_for(TriedChannel(Spoiler(0.5), whole=False))
    assert first.psnr_db > both.psnr_db + 1


def test_only_l0_is_stronger_where_only_l0_is_asked_for() -> None:
    easy, hard = TriedChannel(Spoiler(0.0)), Spoiler(0.6)
    _, weak = marked_for(easy)
    marked, report = marked_for(easy, TriedChannel(hard, whole=False))
    _, strong = marked_for(easy, TriedChannel(Spoiler(0.6)))
    assert strong.psnr_db + 0.5 < report.psnr_db < weak.psnr_db - 0.3
    assert all(whole(marked, 0.0))
    arrived = [out for frame in marked for out in Spoiler(0.6).process(frame)]
    found = receive(arrived, VideoReceiver(WIDTH, HEIGHT, 25))
    assert [s.l0 for s in found] == [source()(k)[0] for k in range(3)]


def test_l1_that_is_hoped_for_gets_what_it_needs_and_no_margin() -> None:
    easy = TriedChannel(Spoiler(0.0))
    _, apart = marked_for(easy, TriedChannel(Spoiler(0.6), whole=False))
    marked, hoped = marked_for(easy, TriedChannel(Spoiler(0.6), whole=False, hoped=True))
    _, asked = marked_for(easy, TriedChannel(Spoiler(0.6)))
    assert asked.psnr_db + 0.3 < hoped.psnr_db < apart.psnr_db - 0.3
    assert all(whole(marked, 0.3))
    never = TriedChannel(Spoiler(60.0), whole=False, hoped=True)
    assert marked_for(easy, never)[1] == marked_for(easy)[1]


def test_a_cleaners_lag_is_taken_back_as_receivers_do(monkeypatch: pytest.MonkeyPatch) -> None:
    def mixed() -> tuple[list[np.ndarray], Any]:
        return marked_for(TriedChannel(Spoiler(0.0)), TriedChannel(Mixer(0.87), whole=False))

    marked, report = mixed()
    mixer = Mixer(0.87)
    arrived = [out for frame in marked for out in mixer.process(frame)]
    found = receive(arrived, VideoReceiver(WIDTH, HEIGHT, 25))
    assert [s.l0 for s in found] == [source()(k)[0] for k in range(3)]
    monkeypatch.setattr("watermark.video.coder_windows.LAGS", ())
    assert report.psnr_db > mixed()[1].psnr_db + 0.3


def test_nothing_is_spent_on_a_channel_where_nothing_arrives() -> None:
    easy = TriedChannel(Spoiler(0.0))
    _, alone = marked_for(easy)
    _, both = marked_for(easy, TriedChannel(Spoiler(60.0), whole=False))
    assert both == alone


def test_l0_gets_all_values_where_it_would_not_arrive() -> None:
    _, never = marked_for(TriedChannel(Spared(), lone=False))
    marked, report = marked_for(TriedChannel(Spared()))
    assert (never.lone, report.lone) == (0, 3)
    assert report.psnr_db > never.psnr_db - 0.05
    coder = Spared()
    arrived = [out for frame in marked for out in coder.process(frame)]
    for frames in (marked, arrived):
        found = receive(frames, VideoReceiver(WIDTH, HEIGHT, 25))
        assert [s.l0 for s in found] == [source()(k)[0] for k in range(3)]
        assert [s.l1 for s in found] == [None] * 3


def test_l0_shares_where_both_arrive_or_nothing_does() -> None:
    for deviation in (0.0, 0.5, 60.0):
        assert marked_for(TriedChannel(Spoiler(deviation)))[1].lone == 0


def test_receivers_follow_to_l0_alone_and_back() -> None:
    frames = [picture(n) for n in range(6 * 16)]
    channel = TriedChannel(Spared(32, 64))
    embedder = VideoEmbedder(WIDTH, HEIGHT, 25, source(), channels=[channel])
    marked = mark(frames, embedder)
    assert embedder.report().lone == 2
    receiver = VideoReceiver(WIDTH, HEIGHT, 25)
    found = receive(marked, receiver)
    assert [s.l0 for s in found] == [source()(k)[0] for k in range(6)]
    assert [s.l1 is None for s in found] == [False, False, True, True, False, False]
    assert receiver.profile is not None
    assert receiver.profile.name == "standard"


@pytest.mark.parametrize("coder", [Swallower(), Spoiler(60.0)])
def test_never_weaker_than_without_where_the_coder_leaves_nothing(coder: Any) -> None:
    plain, plain_report = fixed()
    tried, report = marked_for(TriedChannel(coder))
    assert len(tried) == len(plain)
    assert report.psnr_db <= plain_report.psnr_db + 0.5
