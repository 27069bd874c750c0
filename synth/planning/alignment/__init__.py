"""Subtitles placed on the sound of their speech.

In: captions and the programme's sound. Out: a score on the sound's clock, with a confidence for
each caption. May import: `prosody`, `scoring`.
"""
