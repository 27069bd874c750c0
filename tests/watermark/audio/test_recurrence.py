import numpy as np

from watermark.audio.follow.recurrence import IN_STEP, REMEMBERED, PlacedCandidate, Recurrences
from watermark.audio.search.acquire import Candidate
from watermark.audio.signal.profile import SUPERFRAME
from watermark.audio.signal.sample_buffer import SampleBuffer


def placed(position: float, profile: int = 1) -> PlacedCandidate:
    return PlacedCandidate(position, 1.0, Candidate(position, 0.0, profile, 1, 4.9))


def significance(recurrences: Recurrences, position: float, profile: int = 1) -> float:
    return recurrences.note(placed(position, profile)).candidate.significance


def test_what_comes_again_in_step_is_sure() -> None:
    recurrences = Recurrences()
    assert significance(recurrences, 1000.0) == 4.9
    assert significance(recurrences, 1000.0 + 0.4 * SUPERFRAME) == 4.9
    assert significance(recurrences, 1000.0 + 2 * SUPERFRAME, profile=2) == 4.9
    assert significance(recurrences, 1010.0 + 2 * SUPERFRAME) == 4.9
    assert significance(recurrences, 1003.0 + 3 * SUPERFRAME) == IN_STEP
    recurrences.forget()
    assert significance(recurrences, 1000.0 + 4 * SUPERFRAME) == 4.9


def test_what_is_long_past_counts_no_more() -> None:
    recurrences = Recurrences()
    assert significance(recurrences, 0.0) == 4.9
    assert significance(recurrences, (REMEMBERED + 1.0) * SUPERFRAME) == 4.9


def test_superframes_after_two_in_step_are_tried_where_they_should_lie() -> None:
    recurrences, tape = Recurrences(), SampleBuffer()
    assert recurrences.due(tape) is None
    significance(recurrences, 0.0)
    significance(recurrences, 1.0 * SUPERFRAME)
    tape.append(np.zeros(round(2.9 * SUPERFRAME)))
    assert recurrences.due(tape) is None
    tape.append(np.zeros(20 * SUPERFRAME))
    found = [recurrences.due(tape) for _ in range(REMEMBERED + 1)]
    assert [one and one.position for one in found] == [
        *((2.0 + n) * SUPERFRAME for n in range(REMEMBERED)),
        None,
    ]
    assert found[0] is not None
    assert found[0].candidate.significance == IN_STEP


def test_chance_is_seldom_in_step() -> None:
    """One candidate in 2 s, as unmarked sound gives at most: for hours."""
    rng, recurrences = np.random.default_rng(0), Recurrences()
    places = np.cumsum(rng.exponential(96_000.0, 20_000))
    sure = sum(
        significance(recurrences, at, int(profile)) == IN_STEP
        for at, profile in zip(places, rng.integers(0, 4, places.size), strict=True)
    )
    assert 0 < sure < 20
