"""Progress of long work, on the standard error of a terminal."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def seconds_bar(total_s: float | None, label: str) -> Iterator[Callable[[float], None]]:
    """Show a bar over seconds of programme; give the function that moves it on.

    Nothing is shown where the standard error is not a terminal.
    """
    from tqdm import tqdm

    with tqdm(
        total=None if total_s is None else round(total_s, 2), desc=label, unit="s",
        file=sys.stderr, disable=None, leave=False, dynamic_ncols=True,
        bar_format="{l_bar}{bar}| {n:.0f}/{total:.0f} s, {rate_fmt}" if total_s else None,
    ) as bar:  # fmt: skip
        yield lambda seconds: (bar.update(seconds), None)[1]


def note(text: str) -> None:
    """Print a remark on the standard error."""
    print(text, file=sys.stderr)


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
