"""The sound carrier: marks that coders leave and ears do not hear.

In: a programme's sound in blocks, and superframes. Out: the same sound with its mark; from marked
sound, superframes. May import: `link`, `quality`.
"""
