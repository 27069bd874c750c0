"""Practice and perceptual tests: items of the cuer are shown, answers are collected.

In: texts, pairs of words that look alike on the lips, recordings. Out: pages for learners and
participants, answers as CSV, figures. May import: `command`, `dubbing`, `evaluate`.
"""
