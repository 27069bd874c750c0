"""Labelled points as parameters of a voice.

In: a recording of points, under any labels. Out: a motion; a proposal for labels that are missing.
May import: `cues`, `sources`.
"""
