"""Concatenative synthesis: units chosen and joined, sound and gesture at once.

In: the phones of a sentence with their times, and an archive of units. Out: one recording of the
sentence. May import: `recordings`, `speech`.
"""
