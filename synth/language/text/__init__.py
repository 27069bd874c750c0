"""From written French to the phones of its words.

In: text. Out: `Word` values: phones as spoken there, class, the pause that follows. May import: no
other room.
"""
