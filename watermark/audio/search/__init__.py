"""Acquisition: where superframes lie in sound that may start anywhere, changed in any known way.

In: samples and a profile. Out: candidate offsets and speeds, with a score each. May import:
`signal`.
"""
