"""Options that several verbs share, and the values they stand for."""

import argparse
import math
import sys

CARRIERS = ("audio", "video", "a335")
"""Ways to put a cuer into a programme."""

_MOST_BITS = 400_000_000
"""Most bit/s of pictures: three times those of Ultra HD on a disc."""

REST_S = 0.5
"""Rest before a plain text: the hand sets out a quarter of a second before the first phone."""


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add ``--json``."""
    parser.add_argument("--json", action="store_true", help="print one JSON document")


def add_voice(parser: argparse._ActionsContainer) -> None:
    """Add ``--voice``."""
    parser.add_argument(
        "--voice", default="claire", metavar="V", help="name or file of the cuer's voice"
    )


def add_avatar(parser: argparse._ActionsContainer) -> None:
    """Add ``--avatar``."""
    parser.add_argument(
        "--avatar", metavar="FILE", help="an avatar of one's own: .avatar (see avatar), .vrm, .glb"
    )


def add_seed(parser: argparse._ActionsContainer) -> None:
    """Add ``--seed``."""
    parser.add_argument("--seed", type=natural, default=0, metavar="N", help="seed of the random")


def add_key(parser: argparse._ActionsContainer) -> None:
    """Add ``--key``."""
    parser.add_argument("--key", type=natural, default=0, metavar="N", help="key of the watermark")


def add_text(parser: argparse.ArgumentParser) -> None:
    """Add the choice between a text and a file of subtitles."""
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "text",
        nargs="?",
        metavar="TEXT",
        help=f"French text; {REST_S:g} s of rest come first: the hand rises",
    )
    source.add_argument(
        "--file",
        metavar="SUBS",
        help="subtitles; - reads a pipe; an X-TIMESTAMP-MAP of WebVTT is of the programme's clock "
        "and followed beside the programme alone, by dub",
    )


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add how French text is read and cued, where readers and charts differ."""
    group = parser.add_argument_group("how the text is read and cued")
    group.add_argument("--lexicon", metavar="FILE", help="words with their phones, one a line")
    group.add_argument("--liaison", choices=("obligatory", "none"), default="obligatory")
    group.add_argument(
        "--final-schwa",
        choices=("none", "cluster", "cluster-pause", "all"),
        default="cluster",
        help="when a final mute e is spoken",
    )
    for vowel, name in (("œ̃", "un"), ("pronounced ə", "schwa"), ("œ", "oe")):
        group.add_argument(
            f"--{name}", metavar="PLACEMENT", help=f"placement of {vowel}, such as cheek"
        )
    group.add_argument(
        "--rest-gap",
        type=not_negative,
        metavar="S",
        help="silence after which the hand rests, 0.5 by default",
    )


def add_subtitle_terms(parser: argparse.ArgumentParser) -> None:
    """Add the terms of reading subtitles."""
    group = parser.add_argument_group("how subtitles are read")
    group.add_argument(
        "--strict",
        action="store_true",
        help="refuse a file with a bad subtitle (default: it is skipped and reported)",
    )
    group.add_argument(
        "--offset",
        type=seconds,
        metavar="S",
        help="added to the times of the subtitles, negative for earlier (default: the file's own "
        "hints give the programme's start, such as a tape's ten o'clock)",
    )
    group.add_argument(
        "--everything",
        action="store_true",
        help="cue credits and other languages as well, by the rules of French",
    )
    group.add_argument(
        "--subtitle-profile",
        choices=("fr-sdh", "plain"),
        default="fr-sdh",
        help="fr-sdh: red names sounds, magenta music, green a foreign language, which are not "
        "cued (default); plain: colours mean nothing",
    )


def add_pace(parser: argparse.ArgumentParser) -> None:
    """Add the cuer's own clock."""
    group = parser.add_argument_group("how fast the cuer cues")
    group.add_argument(
        "--pace",
        choices=("readable", "sync"),
        help="readable: so that a viewer can follow, behind the speaker where that needs time "
        "(default); sync: lips and hand in step with the speaker, for close-ups (default where a "
        "recording is followed or speech is made)",
    )
    group.add_argument(
        "--max-lag",
        type=not_negative,
        default=1.5,
        metavar="S",
        help="how far she may be behind the programme, 1.5 s by default",
    )
    group.add_argument(
        "--keys-per-second",
        type=positive,
        default=4.0,
        metavar="N",
        help="rate to aim at, 4 by default, never exceeded by more than a quarter; "
        "words without room are left out, the least important first",
    )
    group.add_argument(
        "--syllables-per-second",
        type=positive,
        default=2.5,
        metavar="N",
        help="as slow as she goes where there is time, 2.5 by default",
    )


def add_alignment(parser: argparse._ActionsContainer) -> None:
    """Add ``--alignment``."""
    parser.add_argument(
        "--alignment",
        choices=("attina", "paper"),
        default="attina",
        help="when the hand is on target: early in the consonant as Attina (2005) measured it, "
        "or in its middle as Gibert, Bailly, Elisei (2004) chose",
    )


def add_motion(parser: argparse._ActionsContainer) -> None:
    """Add how the cuer's motion is made."""
    parser.add_argument(
        "--method",
        choices=("rules", "units"),
        help="rule-based gestures, or joined from recorded units",
    )
    parser.add_argument(
        "--units",
        metavar="SPEAKER",
        help="who speaks: margot, a reader of LibriVox (default), espeak, or a folder that "
        "`voice build` made of a speaker",
    )
    add_alignment(parser)


def natural(text: str) -> int:
    """Read an integer that is not negative.

    Examples
    --------
    >>> natural("12")
    12
    """
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return value


def size(text: str) -> tuple[int, int]:
    """Read width and height of a picture.

    Examples
    --------
    >>> size("1280x720")
    (1280, 720)
    """
    width, cross, height = text.lower().partition("x")
    if not (cross and width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text} is not WIDTHxHEIGHT")
    return int(width), int(height)


def count(text: str) -> int:
    """Read an integer from 1 up."""
    value = natural(text)
    if value == 0:
        raise argparse.ArgumentTypeError("0 is too few")
    return value


def carrier_list(text: str) -> tuple[str, ...]:
    """Read names of carriers, separated by commas.

    Examples
    --------
    >>> carrier_list("audio,video")
    ('audio', 'video')
    """
    names = tuple(text.split(","))
    for name in names:
        if name not in CARRIERS:
            raise argparse.ArgumentTypeError(
                f"no carrier called {name!r}, there are: {', '.join(CARRIERS)}"
            )
    return names


def positive(text: str) -> float:
    """Read a finite number above zero."""
    value = float(text)
    if not (0 < value < math.inf):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def aspect(text: str) -> float:
    """Read a ratio of two sides such as ``16/9`` or ``16:9``, or their quotient.

    Examples
    --------
    >>> aspect("4:3") == aspect("4/3") == 4 / 3, aspect("1.85")
    (True, 1.85)
    """
    width, slash, height = text.replace(":", "/").partition("/")
    try:
        return positive(str(positive(width) / positive(height))) if slash else positive(width)
    except (ValueError, argparse.ArgumentTypeError):
        raise argparse.ArgumentTypeError(
            f"{text} is no ratio such as 16/9, 16:9 or 1.778"
        ) from None


def seconds(text: str) -> float:
    """Read a finite number of seconds of either sign."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a number of seconds")
    return value


def not_negative(text: str) -> float:
    """Read a finite number that is not below zero."""
    value = float(text)
    if not (0 <= value < math.inf):
        raise argparse.ArgumentTypeError(f"{text} is not a number from 0 up")
    return value


def grade(text: str) -> float:
    """Read an objective difference grade."""
    value = float(text)
    if not (-4 <= value <= 0):
        raise argparse.ArgumentTypeError(f"{text} is not a grade from -4 to 0")
    return value


def bit_rate(text: str) -> int:
    """Read a bit rate; a final ``k`` means thousands, ``M`` millions.

    Examples
    --------
    >>> bit_rate("128k"), bit_rate("6M"), bit_rate("64000")
    (128000, 6000000, 64000)
    """
    factor = {"k": 1_000, "K": 1_000, "M": 1_000_000}.get(text[-1:], 1)
    value = float(text if factor == 1 else text[:-1]) * factor
    if not (1 <= value <= _MOST_BITS):
        raise argparse.ArgumentTypeError(f"{text} is not a bit rate from 1 to 400M")
    return round(value)


def print_json(document: object) -> None:
    """Print `document` as one JSON text on the standard output."""
    import json

    json.dump(document, sys.stdout, ensure_ascii=False, indent=1, allow_nan=False)
    sys.stdout.write("\n")
