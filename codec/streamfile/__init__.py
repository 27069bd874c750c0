"""Stream files (``.cue``): a whole motion in few bytes, and its content as text.

In: a motion with its score, or the bytes of a file. Out: the bytes of a file; a motion; a document
that explains the file. May import: `superframe`, `cues`, `cuer`.
"""
