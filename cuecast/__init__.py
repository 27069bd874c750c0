"""The applications and their one command line."""
