"""A second virtual cuer: she moves as real cuers were measured to, by equations of her own.

Nothing here is imported by the codec's resynthesis or by the synthesis by rule, nor imports their
laws of movement: figures that hold for her too do not come from a mirror.
"""
