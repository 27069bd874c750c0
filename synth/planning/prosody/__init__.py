"""Durations, pace, emphasis and melody.

In: words with phones, and the time that they have. Out: the times of phones and keys that a viewer
can read, and a line of pitch. May import: no other room.
"""
