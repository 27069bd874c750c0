"""Section 7 of spec/bitstream.md in plain integers, transcribed from the text."""


class RangeDecoder:
    """A code on its way back to symbols."""

    def __init__(self, data: bytes, tail: int = 0) -> None:
        """(R2, R8) Start decoding; the last `tail` bits of the data are no code."""
        self.data = data[: len(data) - tail // 8]
        self.unknown = 2 ** (tail % 8) - 1
        self.position = 0
        self.range = 2**32 - 1
        self.code = 0
        self.slack = 0
        for _ in range(4):
            self._next_byte()
        self.code = min(self.code, 2**32 - 2)

    def _next_byte(self) -> None:
        byte, slack = 0, 255
        if self.position < len(self.data):
            byte, slack = self.data[self.position], 0
        if self.position == len(self.data) - 1:
            byte, slack = byte - byte % (self.unknown + 1), self.unknown
        self.code = self.code * 256 + byte
        self.slack = self.slack * 256 + slack
        self.position += 1

    def symbol(self, freqs: list[int], limit: int | None = None) -> tuple[int, bool]:
        """(R3, R4, R5, R6) Return the next symbol and whether it is determined.

        A symbol that is not determined is not removed from the code if the caller stops there.
        """
        assert sum(freqs) == 32768
        if limit is not None:
            freqs = [*freqs[:limit], sum(freqs[limit:])]
        unit = self.range // 2**15
        v = min(self.code // unit, 32767)
        start, s = 0, 0
        while v >= start + freqs[s]:
            start += freqs[s]
            s += 1
        last = start + freqs[s] == 32768
        new_range = self.range - unit * start if last else unit * freqs[s]
        determined = self.code + self.slack < unit * start + new_range
        self.code -= unit * start
        self.range = new_range
        while self.range < 2**24:
            self.range *= 256
            self._next_byte()
        return s, determined

    def bits(self, count: int) -> int:
        """(S1) Return a number of `count` equally likely bits."""
        value = 0
        for _ in range(count):
            value = 2 * value + self.symbol([16384, 16384])[0]
        return value
