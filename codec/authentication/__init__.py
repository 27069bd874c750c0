"""Authentic cues: a receiver that knows a broadcaster's key tells his superframes from others'.

The scheme is that of delayed keys (Perrig, Canetti, Tygar, Song: "Efficient authentication and
signing of multicast streams over lossy channels", 2000): tags are made with a key that is on air
only after them. Nobody but the broadcaster has a key before; everybody can check it afterwards,
for keys are a chain of hashes whose end is published. Specification: spec/authentication.md.
"""
