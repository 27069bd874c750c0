"""What the pages of `docs/` are generated from: the code, the specification, and records."""
