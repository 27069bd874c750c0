"""Bytes to coded bits and back: the same for every carrier.

In: the two parts of a superframe and a key. Out: coded bits in their order on air; from soft bits,
the bytes that were sent. May import: no other room.
"""
