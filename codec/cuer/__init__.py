"""The cuer as numbers: layout, motion, voice and models."""
