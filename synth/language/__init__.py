"""French text as phones, and subtitle files as captions.

In: text; subtitle files of seven formats. Out: words with their phones, captions with their times.
May import: no other room.
"""
