"""Recorded speech and gestures, cut, chosen and joined.

In: recordings of a speaker, phones with their times. Out: sound and motion of new sentences. May
import: `language`, `motion`, `planning`.
"""
