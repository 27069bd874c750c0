"""Superframes read one after another from a place that was found.

In: samples and a candidate offset. Out: soft bits, payloads, and the offset, speed and level of the
next superframe. May import: `search`, `signal`.
"""
