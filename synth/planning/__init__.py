"""When each phone is spoken and each key is cued.

In: words, captions or recorded sound. Out: a score: phones and keys with their times. May import:
`language`, `motion`.
"""
