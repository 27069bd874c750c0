"""Programmes: reading their sound, and writing them again with another sound.

In: files of containers that FFmpeg reads. Out: samples, subtitle tracks; the programme with its new
sound and picture. May import: `command`.
"""
