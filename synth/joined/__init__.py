"""Motion by joining recorded units."""
