"""Motion by rule."""
