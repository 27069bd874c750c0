"""Subtitle files as television has them."""

from synth.subtitles.model import Subtitle
from synth.subtitles.read import read_subtitles
from synth.subtitles.spoken import spoken

__all__ = ["Subtitle", "read_subtitles", "spoken"]
