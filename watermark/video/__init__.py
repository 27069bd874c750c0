"""The invisible video carrier: dither modulation of smooth low-frequency templates in luma.

In: luma planes, and superframes. Out: luma planes with their mark; from marked planes, superframes.
May import: `audio`, `link`.
"""
