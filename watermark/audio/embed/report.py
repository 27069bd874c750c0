"""Reports of the embedder: a programme as a whole, and the margin of each superframe."""

from dataclasses import dataclass

from watermark.link.superframe import SUPERFRAME_S


@dataclass(frozen=True, slots=True)
class EmbedReport:
    """What happened to a programme.

    Attributes
    ----------
    duration_s : float
        Length of the programme handed out so far.
    superframes : int
        Superframes written into sound that can carry.
    snr_db : float or None
        Programme's mid over mark; None when nothing was marked.
    odg : float or None
        Objective difference grade of the marked sound, as stereo; None at a fixed level.
    silent_s : tuple of (float, float)
        Start and end of stretches that cannot carry, seconds.
    net_bps, gross_bps : float
        Payload rate and rate of cells.

    Examples
    --------
    >>> from watermark import AudioEmbedder
    >>> embedder = AudioEmbedder(48_000, 1, lambda k: (bytes(20), bytes(7)))
    >>> embedder.report().superframes
    0
    """

    duration_s: float
    superframes: int
    snr_db: float | None
    odg: float | None
    silent_s: tuple[tuple[float, float], ...]
    net_bps: float
    gross_bps: float


@dataclass(frozen=True, slots=True)
class SuperframeMargin:
    """Margin of a superframe by its rehearsal.

    Attributes
    ----------
    number : int
        Of the superframe, on air from `number` * 0.64 s.
    margin : float
        Information that is left, in units of the bits of the message and its checks.
    coder : str
        Name of the coder that leaves least.
    loudest : bool
        Whether it stands at the highest level of all, above the last step: no grade would give it
        more.

    Examples
    --------
    >>> SuperframeMargin(4, 1.7, "aac:128k").margin
    1.7
    """

    number: int
    margin: float
    coder: str
    loudest: bool = False


def spans_of(superframes: list[int]) -> tuple[tuple[float, float], ...]:
    """Join neighbouring superframe numbers to stretches of seconds."""
    spans: list[tuple[float, float]] = []
    for k in superframes:
        start, end = k * SUPERFRAME_S, (k + 1) * SUPERFRAME_S
        if spans and abs(spans[-1][1] - start) < 1e-6:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((start, end))
    return tuple(spans)
