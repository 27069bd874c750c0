"""Avatars of others: a VRM or a glTF file, fitted to the cuer's markers once.

In: a file and a voice. Out: an `Avatar`, and its document, which page, player and `render` draw as
they draw the built-in one. May import: `drawing`.
"""
