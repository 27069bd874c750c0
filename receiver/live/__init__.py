"""Programmes that arrive as they are sent.

In: a stream over the network or from a pipe. Out: events and pages while it runs, restarts after
faults. May import: `media`, `reception`, `television`.
"""
