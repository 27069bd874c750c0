"""The command line: verbs are found, options read, outputs written whole.

In: arguments of the user. Out: the verb's exit code; one line for an error. May import: no other
room.
"""
