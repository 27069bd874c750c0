"""What a cuer or speaker recorded, and where it is kept."""
