"""Labelled points in space to the voice's markers."""
