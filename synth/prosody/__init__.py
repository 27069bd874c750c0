"""When phones sound, and how high."""
