"""Authentic cues: a receiver that knows a broadcaster's key recognises his superframes.

The scheme is that of delayed keys (Perrig, Canetti, Tygar, Song: "Efficient authentication and
signing of multicast streams over lossy channels", 2000): tags are made with a key that is on air
only after them. Nobody but the broadcaster has a key before; everybody can check it afterwards,
for keys are a chain of hashes whose end is published. Specification: spec/authentication.md.

In: superframes and a signing key, or superframes and announced keys. Out: proof fields; a verdict
for each superframe. May import: `files`.
"""
