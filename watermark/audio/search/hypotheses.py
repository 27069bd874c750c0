"""Hypotheses on a sound where the usual search finds nothing.

In: a number of channels; out: all hypotheses, the likeliest first, each with its cost and with the
pause after which it is worth trying again: bands turned in phase (a crossover, a rotator), one
channel inverted, late or alone, another gain, another speed, another duration at its pitch.
Specification: spec/audio-carrier.md, W35 and W42.
"""

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

import numpy as np

from watermark.audio.search.acquire import CLOCK_ERRORS_PPM
from watermark.audio.search.channel_mixes import ECHO, LATE, MID, USUAL, kinds_of
from watermark.audio.signal.profile import PILOT_STEPS

STRETCH_S, SHORT_STRETCH_S = 2.2, 1.45
"""Seconds of sound for trials of bands turned, pieces, speeds and echoes, two superframes wherever
they begin, and for all else: one. Of voices at other speeds or without their echo two show 62 to
100 %, one 38 to 87 %."""

LARGEST_SPEED = 0.06
"""Largest change of speed that is tried, as a share."""

FILM_SPEEDS = (Fraction(25, 24), Fraction(24, 25))
"""Films at 24 pictures a second, or 23.976, played at 25, and the way back."""

NEAR_SPEED = 2e-3
"""Relative error of clocks and tapes: tried on either side with its own range, to 0.35 %, and
between them."""

NEAR_S = 4.0
"""Sound between two tries of each of these: one look misses a fifth of them."""

BROADCAST_SPEEDS = (Fraction(1001, 1000), Fraction(1000, 1001))
"""Pictures at 59.94 a second taken for 60, and the way back; `NEAR_SPEED` looks there, too."""

OTHER_SPEEDS = (Fraction(26, 25), Fraction(25, 26), Fraction(106, 100), Fraction(94, 100))
"""What others mean by 4 %, and speeds that players offer."""

WEAK, BETWEEN = (0.0, 0.5), (0.25, 0.75, 0.125, 0.375, 0.625, 0.875)
"""Parts of a doubling of all steps for gains that moved them, 20 dB double them: none,
where weak pilots add up, and half of one; and all others."""

ECHOED = (0.0, 0.25, 0.5, 0.75)
"""Those tried in sound that was widened."""

GAIN_STEPS = 8
"""Steps of pilots tried for each doubling where phases are turned, too: 2^(1/8) apart, soft values
lose a tenth half-way."""

GAIN_LADDER = range(-GAIN_STEPS, GAIN_STEPS * len(PILOT_STEPS))
"""Those tried in sound of the usual loudness."""

LADDER_PART = 10
"""Of those, how many share one attempt."""

ALWAYS_S, OFTEN_S, AT_TIMES_S, SELDOM_S, RARELY_S = 2.5, 6.0, 10.0, 30.0, 240.0
"""Sound between two tries of turned bands, of the other likely ones, of less likely ones, of tens
of possibilities, and of speeds that no usual device has."""

COST_SIGHT, COST_GAIN, COST_CLOCKS, COST_EVIDENCE, COST_STRETCHED = 1.6, 1.0, 0.5, 0.2, 6.0
"""Cost of a try, in thousandths of a second of a core of the machine that counted it:
looking at a stretch, correlating at one gain, at all clocks instead of likely ones, adding up
evidence of a gain, and pieces."""

COST_LATE, COST_ECHO, COST_MIX = 3.0, 1.5, 0.2
"""The same of finding by how much a channel is late, an echo, and of mixing channels."""

COST_SCAN, COST_STEP = 0.5, 0.4
"""The same of a search blind to phase: of itself and of each step of pilots."""


class PilotHypothesis(Enum):
    """How pilots are sought: as usual, each band at any phase, or in pieces."""

    PLAIN = "plain"
    TURNED = "turned"
    STRETCHED = "stretched"


@dataclass(frozen=True, slots=True)
class ChannelHypothesis:
    """One thing to try.

    Attributes
    ----------
    name : str
        What happened to the sound.
    pause_s : float
        Sound after which it is worth trying again.
    cost : float
        See `COST_SIGHT`.
    mixing : float
        Part of it that is spent on finding its mix, even if there is none.
    mix : str
        Kind of the mix in which to search, see `watermark.audio.search.channel_mixes`.
    kind : PilotHypothesis
        How pilots are sought.
    speed : float
        Samples that come for one of the mark's own.
    clock : float
        The same where it is so near 1 that the sound is looked at as if it were 1.
    gains : tuple of float
        Doublings by which a gain may have moved all steps.
    steps : tuple of float
        Steps that turned pilots may have.
    exact : bool
        Whether the clock is right but for what clocks err by: scores of stretches then add up.
    stretch_s : float
        Sound in which to search, seconds.
    """

    name: str
    pause_s: float
    cost: float
    mixing: float = 0.0
    mix: str = MID
    kind: PilotHypothesis = PilotHypothesis.PLAIN
    speed: float = 1.0
    clock: float = 1.0
    gains: tuple[float, ...] = (0.0,)
    steps: tuple[float, ...] = ()
    exact: bool = True
    stretch_s: float = SHORT_STRETCH_S


def make_hypotheses(channels: int) -> tuple[ChannelHypothesis, ...]:
    """List the hypotheses for a sound of `channels` channels, the likeliest first."""
    turned, pieces = PilotHypothesis.TURNED, PilotHypothesis.STRETCHED
    ladder = [PILOT_STEPS[0] * 2 ** (i / GAIN_STEPS) for i in GAIN_LADDER]
    parts = [ladder[i : i + LADDER_PART] for i in range(0, len(ladder), LADDER_PART)]
    found = [
        _plain("gain", OFTEN_S, gains=WEAK),
        _turned("turned", ALWAYS_S, MID, PILOT_STEPS),
        *(_speed(speed, SELDOM_S) for speed in BROADCAST_SPEEDS),
        *(_speed(speed, OFTEN_S) for speed in FILM_SPEEDS),
        *(_plain(kind, AT_TIMES_S, mix=kind) for kind in kinds_of(channels)),
        *(_near(sign * NEAR_SPEED) for sign in (1, -1, 0)),
        ChannelHypothesis(
            "stretched", AT_TIMES_S, COST_STRETCHED, kind=pieces, exact=False, stretch_s=STRETCH_S
        ),
        _plain("other gain", AT_TIMES_S, gains=BETWEEN),
        *(_speed(speed, AT_TIMES_S) for speed in OTHER_SPEEDS),
        *(
            _plain("echo", AT_TIMES_S, mix=ECHO, gains=ECHOED, stretch_s=STRETCH_S)
            for _ in range(channels > 1)
        ),
        *(_turned(f"turned, gain {n}", SELDOM_S, USUAL, part) for n, part in enumerate(parts)),
        *(_plain(f"speed {1 / x:.4f}", RARELY_S, speed=x, exact=False) for x in speeds()),
    ]
    assert {one.kind for one in found} == {turned, pieces, PilotHypothesis.PLAIN}
    return tuple(found)


def _turned(
    name: str, pause_s: float, mix: str, steps: tuple[float, ...] | list[float]
) -> ChannelHypothesis:
    cost = COST_SCAN + COST_STEP * len(steps)
    if mix != MID:
        cost += COST_MIX + COST_SIGHT * STRETCH_S / SHORT_STRETCH_S
    return ChannelHypothesis(
        name, pause_s, cost, COST_MIX, mix, PilotHypothesis.TURNED, steps=tuple(steps), exact=False,
        stretch_s=STRETCH_S,
    )  # fmt: skip


def _plain(
    name: str, pause_s: float, *, mix: str = MID, speed: float = 1.0, clock: float = 1.0,
    gains: tuple[float, ...] = (0.0,), exact: bool = True, stretch_s: float = SHORT_STRETCH_S,
) -> ChannelHypothesis:  # fmt: skip
    mixing = {MID: 0.0, LATE: COST_LATE, ECHO: COST_ECHO}.get(mix, COST_MIX)
    # The usual search has looked at the usual mix.
    sight = 0.0 if mix == MID and speed == 1.0 else COST_SIGHT
    looking = sight + (COST_GAIN + (COST_EVIDENCE if exact else COST_CLOCKS)) * len(gains)
    return ChannelHypothesis(
        name, pause_s, mixing + looking * stretch_s / SHORT_STRETCH_S, mixing, mix, speed=speed,
        clock=clock, gains=gains, exact=exact, stretch_s=stretch_s,
    )  # fmt: skip


def _speed(speed: Fraction, pause_s: float) -> ChannelHypothesis:
    return _plain(f"speed {speed}", pause_s, speed=float(1 / speed), stretch_s=STRETCH_S)


def _near(by: float) -> ChannelHypothesis:
    name = f"speed {1 / (1 + by):.4f}"
    pause_s = NEAR_S if by else AT_TIMES_S
    return _plain(name, pause_s, clock=1 + by, exact=False, stretch_s=STRETCH_S)


def speeds() -> list[float]:
    """List samples that come for one of the mark's own: a grid that goes on without gaps.

    It begins where the range of `NEAR_SPEED` ends, and has the nearest to 1 first.
    """
    reach = float(CLOCK_ERRORS_PPM.max()) * 1e-6
    count = int(np.ceil((LARGEST_SPEED - NEAR_SPEED - reach) / (2 * reach)))
    away = [NEAR_SPEED + 2 * reach * n for n in range(1, count + 1)]
    return [1 + sign * far for far in away for sign in (1, -1)]
