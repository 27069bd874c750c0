"""Models of a voice and its coding tables, learnt from frames of markers.

In: frames of markers, motions of a voice. Out: a voice; coding tables. May import: `superframe`,
`cuer`, `cues`.
"""
