"""The format on air: superframes of 0.64 s, each readable by itself.

In: a motion with its score, and a number of bytes. Out: the bytes of a superframe; from bytes, in
any order and with holes, the motion again. May import: `files`, `cues`, `cuer`.
"""
