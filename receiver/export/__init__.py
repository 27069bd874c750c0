"""Motion for other programs: C3D, TRC, CSV, glTF, ARKit weights."""
