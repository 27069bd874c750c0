"""From parameters to pictures.

In: a motion and a voice. Out: pictures of the cuer, pixel by pixel. May import: no other room.
"""
