"""Programmes that arrive as they are sent."""
