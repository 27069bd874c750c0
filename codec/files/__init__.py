"""File formats without meaning of their own."""
