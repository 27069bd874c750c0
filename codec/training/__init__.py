"""From recordings to models and coding tables; not needed to code."""
