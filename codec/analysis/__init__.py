"""Motion looked at: which keys it shows, when its movements begin, how two motions differ.

In: a motion or markers. Out: keys, phases of movement, errors in mm. May import: `cuer`, `cues`.
"""
