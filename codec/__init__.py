"""The cuer as numbers, and those numbers as few bits."""
