"""The cuer's body: bones, skin, hand shapes and the poses that reach the placements.

In: joint angles and a cuer's measures. Out: the positions of her 113 markers, in mm. May import: no
other room.
"""
