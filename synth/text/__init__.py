"""French text to phones."""
