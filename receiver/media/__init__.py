"""Reading programmes: containers to samples and luma on the programme's clock.

In: a file or a stream. Out: blocks of samples, planes of luma, with their times. May import: no
other room.
"""
