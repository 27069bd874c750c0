"""Exceptions. Every error of the toolkit derives from `CueError`."""


class CueError(Exception):
    """Root of the toolkit's exceptions: malformed or unusable input.

    The message is one line: the fault, the value found, and the limit.
    """


class BitstreamError(CueError):
    """A bitstream breaks a rule of the specification.

    Parameters
    ----------
    rule : str
        The expected and the found value.
    section : str
        Section of spec/bitstream.md that states the rule.
    bit : int, optional
        Offset of the offending field from the start of the stream, in bits.
    """

    def __init__(self, rule: str, *, section: str, bit: int | None = None) -> None:
        where = "" if bit is None else f" at bit {bit}"
        super().__init__(f"{rule} (section {section}){where}")
        self.section = section
        self.bit = bit


class VoiceError(CueError):
    """A voice file is damaged or foreign, or a stream was made with another voice."""
