"""The invisible video carrier: dither modulation of smooth low-frequency templates in luma."""
