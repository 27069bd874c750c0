"""The demonstration: a programme made on the spot, sent through broadcast codecs, received.

In: nothing. Out: a folder with the programme, its pictures and its figures. May import: `command`,
`dubbing`, `media`.
"""
