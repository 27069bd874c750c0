"""From bits to streams: superframes, their parts and their files."""
