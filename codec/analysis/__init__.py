"""Motions looked at: their keys, their phases, their likeness."""
