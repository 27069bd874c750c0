"""The cuer's body and how it moves.

In: a score (`codec.cues`). Out: a motion of the 31 parameters, or the markers behind it; when a
viewer can read each key. May import: no other room.
"""
