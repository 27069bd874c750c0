"""Programmes: reading their sound, and writing them again with another sound.

Containers and codecs are FFmpeg's, through PyAV; nothing else in the project imports it.
"""
