"""The avatar of a virtual cuer: a skin that follows the 113 markers.

In: the CC0 mesh. Out: ``receiver/assets/avatar_NAME.npz``. May import: all packages.
"""
