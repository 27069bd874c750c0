"""Colours of subtitles by name: of HTML, CSS, TTML and ASS to the eight of teletext."""

import colorsys
import re

_NAMES = {
    "red": "red", "darkred": "red", "crimson": "red", "firebrick": "red", "maroon": "red",
    "magenta": "magenta", "fuchsia": "magenta", "purple": "magenta", "violet": "magenta",
    "green": "green", "lime": "green", "cyan": "cyan", "aqua": "cyan", "blue": "blue",
    "navy": "blue", "yellow": "yellow", "gold": "yellow", "white": "white", "black": "black",
    "gray": "white", "grey": "white", "silver": "white", "rouge": "red", "vert": "green",
    "jaune": "yellow", "bleu": "blue", "blanc": "white",
}  # fmt: skip

_HUES = ((20, "red"), (75, "yellow"), (160, "green"), (205, "cyan"), (265, "blue"),
         (340, "magenta"), (361, "red"))  # fmt: skip
"""Upper ends in degrees."""

_LEAST_SATURATION, _LEAST_VALUE = 0.4, 0.2
"""Below these a colour counts as white or black; set by hand, not measured."""


def colour_name(written: str) -> str:
    """Return the name of a colour as files write it, "" if it is none.

    Examples
    --------
    >>> [colour_name(x) for x in ("#ff0000", "lime", "rgb(255, 0, 255)", "#fff", "bruit")]
    ['red', 'green', 'magenta', 'white', '']
    """
    text = written.strip().strip("\"'").lower()
    if text in _NAMES:
        return _NAMES[text]
    if match := re.fullmatch(r"#?([0-9a-f]{6})(?:[0-9a-f]{2})?", text):
        return of_levels(*bytes.fromhex(match[1]))
    if match := re.fullmatch(r"#([0-9a-f])([0-9a-f])([0-9a-f])[0-9a-f]?", text):
        return of_levels(*(17 * int(digit, 16) for digit in match.groups()))
    if match := re.match(r"rgba?\(\s*(\d+)[\s,]+(\d+)[\s,]+(\d+)", text):
        return of_levels(*(min(255, int(level)) for level in match.groups()))
    return ""


def of_levels(red: int, green: int, blue: int) -> str:
    """Return the name of a colour of levels from 0 to 255."""
    hue, saturation, value = colorsys.rgb_to_hsv(red / 255, green / 255, blue / 255)
    if value < _LEAST_VALUE:
        return "black"
    if saturation < _LEAST_SATURATION:
        return "white"
    return next(name for end, name in _HUES if hue * 360 < end)
