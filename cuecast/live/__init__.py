"""Programmes get their cuer while they run: streams in, the same streams out, soon after."""
