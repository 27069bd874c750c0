"""The keys that a hand shows, told from 21 points of it and from the face.

`seen` says what is looked at, `looks` what keys look like, `lattice` how well frames agree with
keys and with ways between them, `recognise` which keys they are, `follow` where given ones are.
"""
