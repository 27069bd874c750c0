"""From soft bits to keys and motion."""
