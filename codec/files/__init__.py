"""Files that outlive an interruption, and the containers that packages share.

In: bytes, arrays, frames of points. Out: files that are either whole or absent; NPZ and C3D read
with care. May import: no other room.
"""
