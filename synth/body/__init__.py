"""The virtual cuer's body: skin, skeleton, face units and the poses of the code.

Points of the skin go in with their weights, poses come in as angles and unit weights, positions
in millimetres come out. `synth.body.derive` makes the assets from the CC0 mesh.
"""
