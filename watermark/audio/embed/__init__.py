"""The embedder: the strongest mark that keeps the grade, written into the sound.

In: samples in blocks, and the bytes to send. Out: as many samples, with their mark, and a report of
level and grade. May import: `follow`, `signal`.
"""
