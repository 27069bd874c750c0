"""Programmes get their cuer, and give it back.

In: a programme, with subtitles, sound or a filmed interpreter. Out: the programme with its cuer
inside; from such a programme, keys and motion. May import: `command`, `media`.
"""
