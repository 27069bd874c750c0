"""Conformance of anybody's decoder, by a protocol of JSON lines on its stdin and stdout.

In: a command that starts a decoder, the vectors of the specification. Out: a verdict for each case,
with the paragraph that is violated, and the class that the decoder reaches. May import: no other
room. The protocol is in docs/reference/conformance.md.
"""
