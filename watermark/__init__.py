"""Bytes under a noisy programme."""
