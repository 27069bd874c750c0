"""Programmes get their cuer, and give it back."""
