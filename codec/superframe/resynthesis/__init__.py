"""Resynthesis: the movements that a score implies, as parameters.

A joined line of phones and the targets of a voice go in; face, hand, head and forearm come out
at 50 Hz, one frame per tick. The hand moves from key to key along a minimum-jerk course (Flash
and Hogan 1985): it leaves before the sound of its key, by the share of the distance between keys
that Attina (2005, chapter VI) measured, and arrives in the first part of the consonant; targets
that are left early are not quite reached. The face is the mean of the targets of nearby phones,
weighted by dominances that fall off with time (Cohen and Massaro 1993). The result is a pure
function of the line: sender and receiver compute the same prediction.
Specification: spec/bitstream.md, section 5.
"""
