"""A reader of cues who never met our cuer: taught on takes of real ones that the user has.

Landmarks come as `view` sees them; `reader` learns shapes and placements from them, `lips` the
phones. Nothing here knows how the virtual cuer moves or how the codec predicts her, and nothing
that was learnt is kept.
"""
