"""From soft bits to keys and motion.

In: a programme's sound and picture in blocks. Out: events: keys, motion, markers, losses,
who signed. May import: `media`.
"""
