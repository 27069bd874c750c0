"""Programmes get their cuer while they run.

In: streams. Out: the same streams with a cuer inside, soon after. May import: `command`, `dubbing`,
`media`.
"""
