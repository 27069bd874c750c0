"""The command line: verbs are found, options read, outputs written whole."""
