"""Bytes to coded bits and back: the same for every carrier."""
