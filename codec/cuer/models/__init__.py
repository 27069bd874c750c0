"""The statistical models of the cuer: face, hand, their motion, and their inversion."""
