"""Motion capture: recordings of real cuers become motions of a voice.

Markers of any laboratory, face weights of a telephone or landmarks of an image tracker come in;
parameters of the voice, a score of recognised keys and a report of the quality go out.
"""
