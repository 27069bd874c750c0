"""A virtual studio: the virtual cuer performs, cameras with real faults record her.

In: a score, or a sentence of the corpora. Out: takes: true markers, recorded markers, score and
sound. May import: `language`, `motion`, `planning`, `units`.
"""
