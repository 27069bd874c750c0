"""Rule-based movement: hand, head and face under way between their targets.

In: a score. Out: markers or parameters frame by frame, and the time at which each key is visible.
May import: `body`.
"""
