"""Recordings as files of many kinds."""
