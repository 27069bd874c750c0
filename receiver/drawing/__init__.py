"""From parameters to pictures."""
