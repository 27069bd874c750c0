"""A recorded interpreter as a motion.

In: marker files, tables of landmarks, films, a live tracker. Out: a motion of a voice, and the keys
that it shows. May import: `motion`, `planning`.
"""
