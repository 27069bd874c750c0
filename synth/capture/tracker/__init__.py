"""Landmarks of an image tracker as parameters of a voice, from a file or live.

In: landmarks with their times. Out: a motion, frame by frame if live. May import: `cues`, `points`,
`sources`.
"""
