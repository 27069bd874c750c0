"""Proportions of the virtual cuers: what differs from one woman to the next.

The raw mesh belongs to nobody: its fingers are short for an adult (index 71 mm from knuckle to
tip). The lengths here follow the proportions of hand length that Buchholz, Armstrong and
Goldstein (1992, Ergonomics 35:261) give, for women's hands.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from codec.errors import CueError


@dataclass(frozen=True, slots=True)
class Anatomy:
    """Proportions of one cuer.

    Attributes
    ----------
    scale : float
        Size of the whole mesh.
    hand_length_mm : float
        Wrist to tip of the middle finger; phalanges follow in proportion.
    palm : float
        Stretch of wrist and metacarpals along the hand.
    girth : float
        Thickness of fingers and hand.
    upper_arm_mm : float
        Shoulder to elbow.
    face : tuple of float
        Stretch of head and throat: width, height, depth.
    skin_seed : int
        Of the sliding pattern of her skin.
    phalanges : mapping of str to tuple
        Length of each phalange as a part of hand length; the thumb's metacarpal follows the palm.
    """

    scale: float
    hand_length_mm: float
    palm: float
    girth: float
    upper_arm_mm: float
    face: tuple[float, float, float]
    skin_seed: int = 0
    phalanges: Mapping[str, tuple[float | None, ...]] = field(default_factory=lambda: PHALANGES)

    def __post_init__(self) -> None:
        if not 140 <= self.hand_length_mm <= 220:
            raise CueError(f"hand length {self.hand_length_mm} mm is not within 140..220")


@dataclass(frozen=True, slots=True)
class Habits:
    """How one cuer moves.

    Attributes
    ----------
    placement_shift_mm : dict
        Offset of the pointing finger's target from the common one, x, y, z, per placement.
    hand_slope_deg : float
        Direction of the hand in the picture plane, 90 points up.
    palm_turn_deg : float
        Turn of the back of the hand from the viewer towards the outside.
    opening : float
        Size of the articulation of the face.
    asymmetry : float
        Share that the mouth's right side moves more than its left.
    head_mobility : float
        Size of the head's own motion; 1 is a still speaker.
    scatter_mm : float
        Standard deviation of the tip around its target from key to key.
    scatter_deg : float
        Standard deviation of each finger's angles from key to key.
    undershoot : float
        Part of a movement that is left out when it has half of its natural duration.
    """

    placement_shift_mm: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    hand_slope_deg: float = 64.0
    palm_turn_deg: float = 8.0
    opening: float = 1.0
    asymmetry: float = 0.05
    head_mobility: float = 1.0
    scatter_mm: float = 2.0
    scatter_deg: float = 2.0
    undershoot: float = 0.02


PHALANGES: Mapping[str, tuple[float | None, ...]] = {
    "finger1": (None, 0.196, 0.150),
    "finger2": (0.245, 0.143, 0.110),
    "finger3": (0.266, 0.170, 0.118),
    "finger4": (0.244, 0.165, 0.115),
    "finger5": (0.204, 0.117, 0.100),
}
"""Length of each phalange as a part of hand length; the thumb's metacarpal follows the palm."""

IDENTITIES: dict[str, tuple[Anatomy, Habits]] = {
    "claire": (
        Anatomy(
            scale=0.96, hand_length_mm=176.0, palm=0.92, girth=0.97, upper_arm_mm=285.0,
            face=(0.97, 1.0, 1.0),
        ),
        Habits(),
    ),
    "agathe": (
        Anatomy(
            scale=0.99, hand_length_mm=187.0, palm=0.97, girth=1.04, upper_arm_mm=300.0,
            face=(1.0, 0.96, 0.98), skin_seed=1,
        ),
        Habits(
            placement_shift_mm={
                "cheek": (3.0, 4.0, 0.0), "mouth": (-4.0, 2.0, 2.0), "chin": (4.0, 2.0, 0.0),
                "throat": (5.0, -5.0, 0.0), "side": (4.0, 4.0, -4.0),
            },
            hand_slope_deg=56.0, palm_turn_deg=14.0, opening=0.85, asymmetry=-0.12,
            head_mobility=2.2, scatter_mm=5.5, scatter_deg=2.5, undershoot=0.06,
        ),
    ),
    "solange": (
        Anatomy(
            scale=0.98, hand_length_mm=194.0, palm=1.05, girth=0.94, upper_arm_mm=295.0,
            face=(0.99, 1.02, 0.99), skin_seed=2,
            phalanges={
                "finger1": (None, 0.205, 0.136), "finger2": (0.262, 0.139, 0.098),
                "finger3": (0.276, 0.158, 0.106), "finger4": (0.252, 0.150, 0.102),
                "finger5": (0.199, 0.112, 0.088),
            },
        ),
        Habits(
            placement_shift_mm={
                "cheek": (-3.0, 4.0, 0.0), "mouth": (-3.0, -2.0, 2.0), "chin": (4.0, -1.0, 0.0),
                "throat": (-4.0, -4.0, 0.0), "side": (4.0, -2.0, -4.0),
            },
            hand_slope_deg=60.0, palm_turn_deg=11.0, opening=0.92, asymmetry=0.08,
            head_mobility=1.6, scatter_mm=7.0, scatter_deg=6.0,
        ),
    ),
}  # fmt: skip
"""A still speaker; one with longer hands, flatter hand and livelier head; and one whose fingers are
long near the palm and who scatters as real cuers do (the movement of `synth.motion.measured`). The
third one's mouth and chin are 32 mm apart in height, like those of real cuers."""


BY_RULE = ("claire", "agathe")
"""Those who also move by the laws of `synth.motion.rules.movement`, in the figures."""


def identity(name: str) -> tuple[Anatomy, Habits]:
    """Return proportions and habits of a cuer.

    Raises
    ------
    CueError
        If there is no such cuer.

    Examples
    --------
    >>> identity("claire")[0].hand_length_mm
    176.0
    """
    if name not in IDENTITIES:
        raise CueError(f"unknown cuer {name!r}; known: {', '.join(IDENTITIES)}")
    return IDENTITIES[name]
