"""Figures: how well codec, carriers, synthesis and the whole chain do on given material.

In: the options of a kind of measurement (``evaluate(options)``). Out: results and, where a picture
helps, a figure (``plot(results, figure)``). May import: `command`, `demo`, `dubbing`, `media`.
"""
