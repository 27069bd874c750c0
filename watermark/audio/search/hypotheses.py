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

STRETCH_S, SHORT_STRETCH_S = 2.2, 1.36
"""Sound on which a hypothesis is tried: a superframe and its successor, and one superframe,
wherever they begin."""

LARGEST_SPEED = 0.062
"""Largest change of speed that is tried."""

FILM_SPEEDS = (Fraction(25, 24), Fraction(24, 25))
"""Films at 24 pictures a second, or 23.976, played at 25, and the way back."""

OTHER_SPEEDS = (Fraction(26, 25), Fraction(25, 26))
"""What others mean by 4 %."""

NEAR_SPEED = 2.5e-3
"""Part by which clocks and tapes run wrong, more than the usual search allows for: tried on either
side with its own range, 0.1 to 0.4 %."""

HALF, QUARTERS, EIGHTHS = (0.5,), (0.25, 0.75), (0.125, 0.375, 0.625, 0.875)
"""Parts of a doubling of all steps by which a gain may have moved them: 20 dB double them."""

GAIN_STEPS = 8
"""Steps of pilots tried for each doubling where phases are turned, too: 2^(1/8) apart, soft values
lose a tenth half-way."""

GAIN_LADDER = range(-GAIN_STEPS, GAIN_STEPS * len(PILOT_STEPS))
"""Those tried in sound of the usual loudness."""

LADDER_PART = 10
"""Of those, how many share one attempt."""

ALWAYS_S, OFTEN_S, AT_TIMES_S, SELDOM_S = 1.1, 3.0, 5.0, 12.0
"""Sound between two tries of turned bands, of what else is likely, of what is less, and of tens of
possibilities."""

ECHO_S = 8.0
"""The same of an echo: stereo that was widened feeds each channel late into the other."""

COST_EXACT, COST_WIDE, COST_SHORT, COST_STRETCHED, COST_LATE = 9.0, 14.0, 5.0, 19.0, 12.0
"""What a try costs: thousandths of a second of a core of the machine on which it was counted."""

COST_SCAN, COST_STEP = 2.0, 1.3
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
        See `COST_EXACT`.
    mix : str
        Kind of the mix in which to search, see `watermark.audio.search.channel_mixes`.
    kind : PilotHypothesis
        How pilots are sought.
    speed : float
        Samples that come for one of the mark's own.
    gain : float
        Doublings by which a gain moved all steps.
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
    mix: str = MID
    kind: PilotHypothesis = PilotHypothesis.PLAIN
    speed: float = 1.0
    gain: float = 0.0
    steps: tuple[float, ...] = ()
    exact: bool = True
    stretch_s: float = STRETCH_S


def make_hypotheses(channels: int) -> tuple[ChannelHypothesis, ...]:
    """List the hypotheses for a sound of `channels` channels, the likeliest first."""
    turned, pieces = PilotHypothesis.TURNED, PilotHypothesis.STRETCHED
    ladder = [PILOT_STEPS[0] * 2 ** (i / GAIN_STEPS) for i in GAIN_LADDER]
    parts = [ladder[i : i + LADDER_PART] for i in range(0, len(ladder), LADDER_PART)]
    found = [
        _turned("turned", ALWAYS_S, MID, PILOT_STEPS),
        *(_gained(gain, OFTEN_S) for gain in HALF),
        *(
            ChannelHypothesis(kind, AT_TIMES_S, COST_LATE if kind == LATE else COST_EXACT, kind)
            for kind in kinds_of(channels)
        ),
        *(_film(speed, AT_TIMES_S) for speed in FILM_SPEEDS),
        ChannelHypothesis("weak", OFTEN_S, COST_EXACT),
        ChannelHypothesis("stretched", OFTEN_S, COST_STRETCHED, kind=pieces, exact=False),
        *(_near(sign) for sign in (1, -1)),
        *(_gained(gain, AT_TIMES_S) for gain in QUARTERS),
        *(_film(speed, AT_TIMES_S) for speed in OTHER_SPEEDS),
        *(_without_echo(gain) for gain in (0.0, *QUARTERS, *HALF) if channels > 1),
        *(_turned(f"turned, gain {n}", SELDOM_S, USUAL, part) for n, part in enumerate(parts)),
        *(_gained(gain, SELDOM_S) for gain in EIGHTHS),
        *(
            ChannelHypothesis(
                f"speed {1 / speed:.4f}", SELDOM_S, COST_SHORT, speed=speed, exact=False,
                stretch_s=SHORT_STRETCH_S,
            )
            for speed in speeds()
        ),
    ]  # fmt: skip
    assert {one.kind for one in found} == {turned, pieces, PilotHypothesis.PLAIN}
    return tuple(found)


def _turned(
    name: str, pause_s: float, mix: str, steps: tuple[float, ...] | list[float]
) -> ChannelHypothesis:
    cost = COST_SCAN + COST_STEP * len(steps)
    kind = PilotHypothesis.TURNED
    return ChannelHypothesis(name, pause_s, cost, mix, kind, steps=tuple(steps), exact=False)


def _gained(gain: float, pause_s: float) -> ChannelHypothesis:
    return ChannelHypothesis(f"gain {gain:g}", pause_s, COST_EXACT, gain=gain)


def _film(speed: Fraction, pause_s: float) -> ChannelHypothesis:
    return ChannelHypothesis(f"speed {speed}", pause_s, COST_EXACT, speed=float(1 / speed))


def _without_echo(gain: float) -> ChannelHypothesis:
    return ChannelHypothesis(f"echo, gain {gain:g}", ECHO_S, COST_LATE, ECHO, gain=gain)


def _near(sign: int) -> ChannelHypothesis:
    speed = 1 + sign * NEAR_SPEED
    name = f"speed {1 / speed:.4f}"
    return ChannelHypothesis(name, AT_TIMES_S, COST_WIDE, speed=speed, exact=False)


def speeds() -> list[float]:
    """List samples that come for one of the mark's own: a grid that goes on without gaps.

    It begins where the range of `NEAR_SPEED` ends, and has the nearest to 1 first.
    """
    reach = float(CLOCK_ERRORS_PPM.max()) * 1e-6
    count = int(np.ceil((LARGEST_SPEED - NEAR_SPEED - reach) / (2 * reach)))
    away = [NEAR_SPEED + 2 * reach * n for n in range(1, count + 1)]
    return [1 + sign * far for far in away for sign in (1, -1)]
