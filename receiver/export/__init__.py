"""Motion for other programs: C3D, TRC, CSV, glTF, ARKit weights.

In: a motion and a voice. Out: files. May import: `drawing`.
"""
