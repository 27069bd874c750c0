"""The sound of synthetic speech: pitch, pitch marks, TD-PSOLA and line spectrum pairs."""
