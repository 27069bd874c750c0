"""Independent virtual cuers, who move as real ones were measured to.

In: a score and a cuer's number. Out: markers frame by frame, from models that the codec does not
share. May import: `body`, `rules`.
"""
