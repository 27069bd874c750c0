"""Reading recordings, each format by its content.

In: the bytes of a file. Out: labelled points or landmarks with their times. May import: no other
room.
"""
