"""Figures: how well codec, carriers, synthesis and the whole chain do on given material.

One module per kind, with ``evaluate(options)`` for the results and, where a picture helps,
``plot(results, figure)``.
"""
