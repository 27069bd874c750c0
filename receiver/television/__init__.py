"""The page and its server.

In: a programme and the events of its reception. Out: a page that plays the programme with its cuer.
May import: `drawing`, `media`, `reception`.
"""
