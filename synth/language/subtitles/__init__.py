"""Reading subtitles, whatever their format, dialect and damage.

In: the bytes of a file. Out: `Subtitle` values on the programme's clock, findings about the file,
the words that are spoken. May import: `text`.
"""

from typing import TYPE_CHECKING, Any

from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.spoken import spoken

if TYPE_CHECKING:
    from synth.language.subtitles.read import read_subtitles

__all__ = ["Subtitle", "read_subtitles", "spoken"]

if not TYPE_CHECKING:  # type checkers would take any name for one of ours

    def __getattr__(name: str) -> Any:
        if name != "read_subtitles":
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        # A text alone needs none of the formats.
        from synth.language.subtitles.read import read_subtitles

        return read_subtitles
