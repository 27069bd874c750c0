"""Exceptions. Every error of the toolkit derives from `CueError`."""


class CueError(Exception):
    """Root of the toolkit's exceptions: malformed or unusable input.

    The message is one line: the fault, the value found, and the limit.

    Examples
    --------
    >>> raise CueError("rate 5 bit/s is not within 60..20000")
    Traceback (most recent call last):
    codec.errors.CueError: rate 5 bit/s is not within 60..20000
    """


class BitstreamError(CueError):
    """A bitstream breaks a rule of the specification.

    Parameters
    ----------
    rule : str
        The rule that is broken: what was expected and what was found.
    section : str
        Section of spec/bitstream.md that states the rule.
    bit : int, optional
        Offset of the offending field from the start of the stream, in bits.
    cause : str, optional
        What probably happened, where that can be said.

    Examples
    --------
    >>> fault = BitstreamError("3 bytes too many", section="F6", bit=96)
    >>> print(fault)
    3 bytes too many (section F6) at bit 96
    >>> print(fault.explain())
    fault: 3 bytes too many
    where: bit 96, that is byte 12
    rule: spec/bitstream.md, F6
    """

    def __init__(self, rule: str, *, section: str, bit: int | None = None, cause: str = "") -> None:
        where = "" if bit is None else f" at bit {bit}"
        likely = f": {cause}" if cause else ""
        super().__init__(f"{rule} (section {section}){where}{likely}")
        self.rule = rule
        self.section = section
        self.bit = bit
        self.cause = cause

    def explain(self) -> str:
        """Return the fault in several lines: what was found, where, which rule, likely cause."""
        lines = [f"fault: {self.rule}"]
        if self.bit is not None:
            lines.append(f"where: bit {self.bit}, that is byte {self.bit // 8}")
        lines.append(f"rule: spec/bitstream.md, {self.section}")
        if self.cause:
            lines.append(f"likely cause: {self.cause}")
        return "\n".join(lines)


def check_kind(value: object, kind: type, taker: str, source: str = "") -> None:
    """Refuse an argument of another kind than a face takes.

    Parameters
    ----------
    value : object
    kind : type
        What `taker` needs.
    taker : str
        The function that was called.
    source : str
        Where such a value is to be had, as the end of the message.

    Raises
    ------
    CueError
        If `value` is no `kind`.

    Examples
    --------
    >>> check_kind("Bonsoir", int, "reach", "len gives one")
    Traceback (most recent call last):
    codec.errors.CueError: reach takes int, not str: len gives one
    """
    if not isinstance(value, kind):
        hint = f": {source}" if source else ""
        raise CueError(f"{taker} takes {kind.__name__}, not {type(value).__name__}{hint}")


class VoiceError(CueError):
    """A voice file is damaged or foreign, or a stream was made with another voice.

    Examples
    --------
    >>> issubclass(VoiceError, CueError)
    True
    """
