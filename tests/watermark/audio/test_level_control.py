"""The base level that serves margin and grade."""

import pytest

from watermark.audio.embed.level_control import GRADES_PER_LEVEL, OVERDRAFT, LevelControl

LOWEST, QUIET = -0.4, -0.12


def solved(
    enough: float | None, least: float | None = None, *, quiet: bool = True
) -> tuple[float, float]:
    """Base and lack where a base of 5 had the grade -.26, half-way between the bounds."""
    control = LevelControl(LOWEST, 1, quiet=quiet)
    return control._solve(5.0, -0.26, enough, least), control.lack


def test_the_margin_decides_between_the_grades() -> None:
    for enough in (4.6, 5.0, 5.4):
        assert solved(enough) == (enough, 0.0)


def test_no_softer_than_what_nobody_hears() -> None:
    base, lack = solved(1.0)
    assert base == pytest.approx(5 - (QUIET + 0.26) / GRADES_PER_LEVEL)
    assert lack == 0


def test_no_louder_than_the_lowest_grade() -> None:
    base, lack = solved(9.0)
    assert base == pytest.approx(5 + (-0.26 - LOWEST) / GRADES_PER_LEVEL)
    assert lack == pytest.approx(9.0 - base)


def test_the_grade_gives_way_a_little_to_the_least_margin() -> None:
    bases = [solved(9.0, least)[0] for least in (4.0, 5.0, 5.5, 6.0, 9.0)]
    assert bases[0] == bases[1] < bases[2] < bases[3] == bases[4]
    assert bases[4] - bases[0] == pytest.approx(OVERDRAFT / GRADES_PER_LEVEL)


def test_without_a_rehearsal_the_grade_is_the_aim() -> None:
    base, lack = solved(None, quiet=False)
    assert base == pytest.approx(5 + (-0.26 - LOWEST) / GRADES_PER_LEVEL)
    assert lack == 0
