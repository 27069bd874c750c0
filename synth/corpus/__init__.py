"""The three corpora of the paper, performed by a virtual cuer.

1. all transitions between the hand shapes, in free space; 2. isolated vowels and VCV with a, i, u,
without cueing; 3. sentences with cueing (Gibert, Bailly, Elisei 2004, section 2).
"""
