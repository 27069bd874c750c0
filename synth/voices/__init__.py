"""A voice learnt from a new speaker's takes.

In: folders of C3D files, each with a TextGrid. Out: models and targets of a voice, motions to train
its tables on, recorded units. May import: `capture`, `motion`, `planning`, `units`.
"""
