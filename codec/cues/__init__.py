"""French Cued Speech itself: phones, keys, scores.

In: phones with their times. Out: keys with their times, as a score; a score as ticks. May import:
`files`.
"""
