"""The line of ATSC A/335: data in the first two luma lines of a frame, and A/336 messages in it."""
