"""Reading subtitles, whatever their format, dialect and damage.

In: the bytes of a file. Out: `Subtitle` values on the programme's clock, findings about the file,
the words that are spoken. May import: `text`.
"""

from synth.language.subtitles.model import Subtitle
from synth.language.subtitles.read import read_subtitles
from synth.language.subtitles.spoken import spoken

__all__ = ["Subtitle", "read_subtitles", "spoken"]
