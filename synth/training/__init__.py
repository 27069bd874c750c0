"""Programs that make the package's assets again."""
