"""Forced alignment: where in a recording the phones of its text are spoken."""
