"""How a cuer's hand moves from key to key: the constants of its timing and of its courses.

They are data of the voice. Strokes overlap and add up (superposition of minimum-jerk strokes:
Flash and Hogan 1985; Flash and Henis 1991), so that the hand passes through its targets slowly
instead of stopping dead, and its way is curved.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from codec.errors import CueError


@dataclass(frozen=True, slots=True)
class Movement:
    """Constants of the hand's movement.

    Attributes
    ----------
    lead_share, calm_share, hurried_s : float
        The hand leaves ahead of a key's sound, by this part of the time since the key before and
        by the second part of what exceeds the last...
    least_lead_s, most_lead_s, lead_s_per_mm : float
        ... but not later, and not earlier, which grows with the way.
    lag_share : float
        It arrives after this part of the consonant.
    overlap : float
        Part of a stroke that may still be under way when the next one begins.
    shortest_s : float
        Least length of a stroke.
    fastest_m_s, late_s : float
        Peak speed that a stroke keeps to, as long as it arrives no more than so much too late.
    first_lead_s, rest_delay_s, rest_move_s : float
        How early it rises from rest, how long it waits before it goes there, how long it takes.
    stroke_s : float
        Shortest stroke for which the next six hold fully; they shrink with shorter ones.
    fingers_begin_s, fingers_end_s, head_begin_s, head_end_s, turn_begin_s, turn_end_s : float
        How much later than the hand's place the strokes of fingers, head and wrist begin and end.
    power : float
        Exponent of the elapsed part of a stroke before the minimum-jerk course: below 1 its speed
        peaks early and its end is slow.
    undershoot, natural_s : float
        Part of a stroke that is left out when it has half of its natural length.
    """

    lead_share: float
    calm_share: float
    hurried_s: float
    least_lead_s: float
    most_lead_s: float
    lead_s_per_mm: float
    lag_share: float
    overlap: float
    shortest_s: float
    fastest_m_s: float
    late_s: float
    first_lead_s: float
    rest_delay_s: float
    rest_move_s: float
    stroke_s: float
    fingers_begin_s: float
    fingers_end_s: float
    head_begin_s: float
    head_end_s: float
    turn_begin_s: float
    turn_end_s: float
    power: float
    undershoot: float
    natural_s: float

    @property
    def peak_s_per_mm(self) -> float:
        """Least length of a stroke per mm of its way, seconds: its peak is 15/8 of its mean."""
        return 1.875 / (1000.0 * self.fastest_m_s)

    def __post_init__(self) -> None:
        for item in fields(self):
            value = round(float(np.float32(getattr(self, item.name))), 6)
            if not -10.0 <= value <= 10.0:
                raise CueError(f"movement: {item.name} is {value}, not within -10..10")
            object.__setattr__(self, item.name, value)

    def as_array(self) -> NDArray[np.float32]:
        """Return the constants in the order of the attributes, float32."""
        return np.array([getattr(self, item.name) for item in fields(self)], dtype="<f4")

    @classmethod
    def from_array(cls, values: NDArray[np.float32]) -> "Movement":
        """Return the movement of `as_array`.

        Raises
        ------
        CueError
            If there are too few or too many constants, or one is out of range.
        """
        if values.shape != (len(fields(cls)),):
            raise CueError(f"movement: {values.shape} constants, not {len(fields(cls))}")
        return cls(*values.tolist())


FLOWING = Movement(
    lead_share=0.75, calm_share=3.13, hurried_s=0.24, least_lead_s=0.1, most_lead_s=0.3,
    lead_s_per_mm=0.002, lag_share=0.3, overlap=0.51, shortest_s=0.08, fastest_m_s=0.84,
    late_s=0.1, first_lead_s=0.5, rest_delay_s=0.08, rest_move_s=0.7, stroke_s=0.42,
    fingers_begin_s=0.01, fingers_end_s=-0.05, head_begin_s=0.04, head_end_s=0.08,
    turn_begin_s=0.05, turn_end_s=0.15, power=1.05, undershoot=0.0, natural_s=0.25,
)  # fmt: skip
"""As real cuers move: strokes of 200 to 535 ms that grow with the way, hardly a true hold.

Found by a random search for the statistics of two real cuers at 3.25 keys a second (strokes'
length, holds, peak speed, path over chord, fingers against hand, hand against lips), under the
condition that the hand shows its keys at 5 to 6 keys a second and knuckles stay below 1.5 m/s.
The hand arrives later in the consonant than Attina (2005) found, between her 0.16 and the middle
of it (Gibert, Bailly, Elisei 2004): real cuers arrive 167 ms before the vowel's lips.
`cuecast evaluate readability` measures the statistics.
"""
