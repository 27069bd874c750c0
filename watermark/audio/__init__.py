"""The sound carrier: marks that coders leave and ears do not hear."""
