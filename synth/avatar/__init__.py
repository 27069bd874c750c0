"""The avatar of a virtual cuer: a skin that follows the 113 markers, built from the CC0 mesh."""
