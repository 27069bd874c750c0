"""What is tried when: the same spend in every second, nothing forgotten, evidence that adds up."""

import numpy as np
import pytest

from watermark.audio.follow.align import read_view
from watermark.audio.follow.demodulate import Demodulator
from watermark.audio.follow.equaliser import Equaliser
from watermark.audio.follow.past import PastReader
from watermark.audio.follow.purse import EARNED, HUNTING, RECENT_S, SAVED, DecodingPurse, Ventures
from watermark.audio.follow.retries import Retries
from watermark.audio.follow.track import Track
from watermark.audio.follow.track_reader import TrackReader
from watermark.audio.search import _evidence_kernels
from watermark.audio.search.channel_mixes import ECHO, find_mix
from watermark.audio.search.evidence import Evidence
from watermark.audio.search.hypotheses import NEAR_SPEED, RARELY_S, STRETCH_S, make_hypotheses
from watermark.audio.search.scheduler import FIRST, SPEND, HypothesisScheduler
from watermark.audio.search.scheduler import SAVED_S as HUNT_SAVED_S
from watermark.audio.search.sound_ring import SoundRing
from watermark.audio.signal.masking import make_masker
from watermark.audio.signal.profile import FS, STANDARD, SUPERFRAME
from watermark.audio.signal.sample_buffer import SampleBuffer, StereoBuffer

STEP_S = 0.08


def tries(
    scheduler: HypothesisScheduler, begin_s: float, end_s: float
) -> list[tuple[float, str, float]]:
    """Time, name and cost of what is tried."""
    found = []
    for n in range(round(begin_s / STEP_S), round(end_s / STEP_S)):
        scheduler.earn(STEP_S)
        while (one := scheduler.next(n * STEP_S)) is not None:
            found.append((n * STEP_S, one.name, one.cost))
    return found


@pytest.mark.parametrize("channels", [1, 6])
def test_all_is_tried_again_and_again_at_the_same_spend(channels: int) -> None:
    found = tries(HypothesisScheduler(channels), STRETCH_S, 900.0)
    names = {one.name for one in make_hypotheses(channels)}
    for begin in (STRETCH_S, 300.0, 500.0):
        within = [one for one in found if begin <= one[0] < begin + 1.6 * RARELY_S]
        assert {name for _, name, _ in within} == names
    spent = np.zeros(900)
    for time_s, _, cost in found:
        spent[int(time_s)] += cost
    assert spent[:3].sum() <= FIRST + 3 * SPEND
    assert spent[60:].max() <= SPEND * (1 + HUNT_SAVED_S)
    np.testing.assert_allclose(spent[100:300].mean(), spent[600:800].mean(), rtol=0.02)


def test_what_was_read_comes_first_and_more_often() -> None:
    counts = []
    for known in (False, True):
        scheduler = HypothesisScheduler(2)
        film = next(one for one in make_hypotheses(2) if one.name == "speed 25/24")
        own = next(
            entry.hypothesis for entry in scheduler._entries if entry.hypothesis.name == film.name
        )
        if known:
            scheduler.remember(own)
        found = tries(scheduler, STRETCH_S, 60.0)
        counts.append(sum(name == film.name for _, name, _ in found))
        assert known == (found[0][1] == film.name)
    assert counts[1] > 2 * counts[0]


def test_near_speeds_are_looked_at_twice_in_fifteen_seconds() -> None:
    """One look misses a fifth of them; a look takes a whole stretch of the mark."""
    found = tries(HypothesisScheduler(2), STRETCH_S, 300.0)
    for by in (NEAR_SPEED, -NEAR_SPEED):
        name = f"speed {1 / (1 + by):.4f}"
        times = np.array([time_s for time_s, one, _ in found if one == name])
        assert (times[2:] - times[:-2]).max() + STRETCH_S < 15.0  # measured: 14.0 and 14.7


def test_where_there_was_nothing_to_search_is_looked_again_sooner() -> None:
    waits = []
    for needless in (False, True):
        scheduler, times = HypothesisScheduler(2), list[float]()
        for n in range(round(STRETCH_S / STEP_S), round(300 / STEP_S)):
            scheduler.earn(STEP_S)
            while (one := scheduler.next(n * STEP_S)) is not None:
                if one.mix == ECHO:
                    times.append(n * STEP_S)
                    if needless:
                        scheduler.give_back(one)
        waits.append(np.diff(times)[1:].mean())
    assert waits[1] < 0.7 * waits[0]


def test_the_past_is_read_of_what_superframes_that_are_due_leave() -> None:
    """Reading it all emptied the purse before the second superframe, which shows the gain."""
    purse = DecodingPurse(balance=0.49 * SAVED)
    past = PastReader(FS, TrackReader(0, 1.0, purse), purse)
    tape = StereoBuffer()
    tape.append_pair(*np.zeros((2, 6 * SUPERFRAME)))
    demodulator = Demodulator(STANDARD, 0, purse)
    place = 4.0 * SUPERFRAME
    track = Track(place, 1.0, demodulator, 3.0, Equaliser(demodulator.bands))
    past.start(track, 0.0, np.inf)
    assert past.read(tape) == []
    assert track.position == place
    purse.earn(0.1)
    assert past.read(tape) == []
    assert track.position == place - SUPERFRAME
    assert purse.balance < 0.5 * SAVED


def test_weak_pilots_add_up_over_stretches() -> None:
    """A score of two deviations, alone far below the highest of noise, stands out after ten."""
    rng, period, place = np.random.default_rng(0), 500, 123
    evidence, first, found = Evidence(), 40, []
    for _ in range(10):
        peaks = rng.normal(0.0, 100.0, (4, 3 * period))
        peaks[2, (place - first) % period :: period] += 200.0
        pair, at, significance = evidence.add(peaks.astype(np.int16), first, period)
        found.append((pair, (at + first) % period))
        first += 777
    assert found[-1] == (2, place)
    assert significance > 5.5
    noise = Evidence()
    highest = [
        noise.add(rng.normal(0.0, 100.0, (4, 3 * period)).astype(np.int16), n * 777, period)[2]
        for n in range(40)
    ]
    assert np.mean(highest) < 4.5


def test_evidence_is_added_as_its_python_says() -> None:
    rng = np.random.default_rng(3)
    kernel, results = _evidence_kernels.add_stretch, []
    for add in dict.fromkeys([kernel, getattr(kernel, "py_func", kernel)]):
        rng = np.random.default_rng(3)
        before, own = np.zeros((2, 50), dtype=np.float32), []
        for first in (0, 17, 49):
            best, where = np.empty(2, dtype=np.float32), np.empty(2, dtype=np.int64)
            peaks = rng.normal(0.0, 10.0, (2, 120)).astype(np.float32)
            add(peaks, first, before, 3, np.float32(0.8), best, where)
            own += [*best, *where]
        results.append([*own, *before.reshape(-1)])
    np.testing.assert_allclose(results[0], results[-1], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(("quiet_s", "rate"), [(0.0, EARNED), (RECENT_S, HUNTING)])
def test_the_purse_pays_no_more_than_the_sound_earned(quiet_s: float, rate: float) -> None:
    purse, paid = DecodingPurse(), 0.0
    for _ in range(1000):
        purse.earn(0.64, quiet_s)
        while purse.pays(6.5):
            paid += 6.5
    assert paid <= SAVED + rate * 640.0
    assert paid > 0.99 * rate * 640.0
    assert purse.untried == 1000
    with purse.keeping(0.5):
        assert not purse.affords(0.5 * SAVED)
    before = purse.balance
    purse.charge(10.0)
    assert purse.balance == before - 10.0
    purse.charge(1e6)
    assert purse.balance == -SAVED
    assert not purse.pays(1.0)
    purse.earn(SAVED / rate + 0.1, quiet_s)
    assert purse.pays(1.0)


def test_candidates_that_leave_no_doubt_are_not_free() -> None:
    """Pilots of a mark that cannot be read stand out in every second: the purse bounds them too."""
    purse = DecodingPurse()
    ventures, spent = Ventures(purse), 0.0
    for _ in range(1000):
        purse.earn(0.1, RECENT_S)
        ventures.earn(0.1)
        while ventures.allows(9.0):
            with ventures.attempt(9.0, 5.0):
                while purse.pays(6.0):
                    spent += 6.0
    assert 0.9 * HUNTING * 100 < spent < SAVED + HUNTING * 100


def test_the_kind_of_attempt_that_succeeds_comes_first() -> None:
    """Under a voice masks of interference read more, through coders longer lists."""
    sound = np.random.default_rng(1).normal(0, 0.1, 40_000)
    tape = SampleBuffer()
    tape.append(sound)
    demodulator = Demodulator(STANDARD, 0)
    view = read_view(tape, 960.0, 1.0, make_masker())
    clues = view.clues(demodulator.layout.cells, make_masker())

    def kinds(retries: Retries, good: str) -> list[str]:
        found = []
        for _ in retries.attempts(view, clues, [3.0, 4.0], 0.0, due=True):
            found.append(retries._kind)
            retries.note(retries._kind == good)
        return list(dict.fromkeys(found))

    for good in ("covered", "plain"):
        retries = Retries(demodulator)
        first = [kinds(retries, good) for _ in range(6)]
        assert first[-1][0] == good
        assert all(set(names) == set(first[0]) for names in first)
    poor = DecodingPurse(balance=12.0)
    some = list(Retries(Demodulator(STANDARD, 0, poor)).attempts(view, clues, [3.0], 0.0, due=True))
    assert 0 < len(some) < 9
    assert poor.untried


@pytest.mark.parametrize(("late", "own", "beside"), [(960, -0.6, 0.3), (480, 0.4, 0.0)])
def test_an_echo_is_found_and_taken_out(late: int, own: float, beside: float) -> None:
    """Whatever the blocks, and but for the error of its factor."""
    rng = np.random.default_rng(0)
    mid, side = rng.normal(0, 0.1, (2, 106_000))
    heard = []
    for sound, factor in ((mid, own), (side, beside)):
        echoed = sound.copy()
        echoed[late:] += factor * sound[:-late]
        heard.append(echoed)
    block = np.stack([heard[0] + heard[1], heard[0] - heard[1]], axis=1)
    assert find_mix(ECHO, np.stack([mid + side, mid - side], axis=1)) is None
    mix = find_mix(ECHO, block)
    assert mix is not None
    assert mix.echo == pytest.approx((late, own, beside), abs=0.05)
    ring, tapes = SoundRing(2, 1.0), [StereoBuffer(), StereoBuffer()]
    for first in range(0, len(block), 7001):
        ring.append(block[first : first + 7001])
        ring.extend(tapes[0], mix, ring.end)
    ring.extend(tapes[1], mix, ring.end)
    np.testing.assert_array_equal(tapes[0].samples, tapes[1].samples)
    left = tapes[0].samples[late * 10 :] - mid[late * 10 :]
    assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(mid**2))
