"""The cuer: 113 markers, the motion of a voice's parameters, and the models between the two.

In: a voice file, markers or parameters. Out: parameters, markers, gestures. May import: `files`,
`cues`.
"""
