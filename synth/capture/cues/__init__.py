"""Keys recognised in a recorded hand.

In: landmarks of hand and face, or a motion. Out: keys and phones with their times and confidences.
May import: `sources`.
"""
