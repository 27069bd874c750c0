"""Where motion comes from: text, subtitles, motion capture."""
