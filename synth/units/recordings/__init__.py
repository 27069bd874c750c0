"""The recordings of a speaker as an archive of units.

In: sound and motion of read sentences. Out: `Recording` values with phones and pitch marks, and
which sentences to record. May import: `speech`.
"""
