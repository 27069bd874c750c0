"""Landmarks of an image tracker to the voice's markers."""
