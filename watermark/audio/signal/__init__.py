"""What embedder and receiver compute alike: transform, mask, layout, dither, channels.

In: samples, a profile, a key. Out: spectra, masking thresholds, signs and places of pilots and
bits. May import: no other room.
"""
