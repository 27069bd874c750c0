"""Sound of speech: a synthetic voice, pitch, and changes of pitch and pace.

In: phones, or samples of speech. Out: samples, pitch marks, spectral lines. May import: no other
room.
"""
