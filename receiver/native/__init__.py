"""The receiver in portable C11, for televisions, phones and pages.

In: sound in blocks, a voice's file. Out: superframes, keys, motion, markers; a library, a
WebAssembly module, the program `cue_dec`. May import: nothing of the project.
"""
