"""The line of ATSC A/335: data in the first two luma lines of a frame, and A/336 messages in it.

In: luma lines, and superframes. Out: marked lines; from marked lines, superframes. May import:
`link`.
"""
