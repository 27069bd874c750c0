"""Progress of long work, on the standard error of a terminal."""

import sys
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def seconds_bar(total_s: float | None, label: str) -> Iterator[Callable[[float], None]]:
    """Show a bar over seconds of programme; give the function that moves it on.

    Nothing is shown where the standard error is not a terminal.
    """
    from tqdm import tqdm

    with tqdm(
        total=None if total_s is None else round(total_s, 2),
        desc=label,
        unit="s",
        file=sys.stderr,
        disable=None,
        leave=False,
        dynamic_ncols=True,
        bar_format="{l_bar}{bar}| {n:.0f}/{total:.0f} s, {rate_fmt}"
        if total_s
        else "{desc}: {n:.0f} s [{elapsed}, {rate_fmt}]",
    ) as bar:
        yield lambda seconds: (bar.update(seconds), None)[1]


def note(text: str) -> None:
    """Print a remark on the standard error, on one line or several."""
    print("\n".join(printable(line) for line in text.split("\n")), file=sys.stderr)


def printable(text: str) -> str:
    r"""Return text with what would steer a terminal made visible.

    Names and messages come from files: escape sequences in them can move the cursor, change the
    window's title or hide what follows. So can marks that turn the direction of writing.

    Examples
    --------
    >>> printable("a\x1b[2Jb")
    'a\\x1b[2Jb'
    >>> printable("pâté ɔ̃")
    'pâté ɔ̃'
    """
    return "".join(c if _is_plain(c) else ascii(c)[1:-1] for c in text)


def _is_plain(letter: str) -> bool:
    kind = unicodedata.category(letter)
    return kind not in ("Cc", "Cf", "Cs", "Zl", "Zp")


@contextmanager
def count_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar over a number of things; give the function (done, total) that moves it.

    Nothing is shown before the first call, nor where the standard error is not a terminal.
    """
    from tqdm import tqdm

    bars: list[tqdm[None]] = []

    def move(done: int, total: int) -> None:
        if not bars:
            bars.append(tqdm(total=total, desc=label, file=sys.stderr, disable=None, leave=False))
        bars[0].update(done - bars[0].n)

    try:
        yield move
    finally:
        for bar in bars:
            bar.close()
