"""Scores of texts, captions and drills, and their files.

In: text, captions, a TextGrid or cue notation. Out: a score. May import: `prosody`.
"""
