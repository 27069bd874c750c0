"""The symbolic line: phones, keys, and their times on the grid of ticks."""
