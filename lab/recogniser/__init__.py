"""The phone recogniser of the aligner, learnt.

In: the encoder of Whisper and recordings. Out: ``synth/assets/ear.npz`` and ``heard_phones.npz``.
May import: all packages.
"""
