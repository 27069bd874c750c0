"""Encoding of compact superframes: the score alone, in few bytes.

Specification: spec/bitstream.md, section 3.1.
"""

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.cues.score import Score
from codec.cues.timeline import to_line
from codec.errors import CueError
from codec.superframe.coding import coding_for
from codec.superframe.slow_channel import SlowSender, usual_sender
from codec.superframe.superframe import Superframe
from codec.superframe.window import MAX_BYTES, MIN_BYTES
from codec.superframe.window_writer import WindowWriter


class CompactEncoder:
    """Encoder of compact superframes of constant size.

    Parameters
    ----------
    voice : Voice
        Of the motion.
    l0_bytes : int
        Size of a superframe, 4 to 12.
    options : CueingOptions
        Under which the receiver derives keys from phones.
    first : int
        Number of the first superframe that will be on air: windows lean on earlier ones.
    signed : bool
        Leave room for a proof of who speaks (`codec.superframe.checks.with_proof`).
    slow : SlowSender, optional
        Sends lasting facts; default: language and coding of a voice that is not French.

    Raises
    ------
    CueError
        If the size is out of range.
    """

    def __init__(
        self,
        voice: Voice,
        *,
        l0_bytes: int,
        options: CueingOptions = DEFAULT_OPTIONS,
        first: int = 0,
        signed: bool = False,
        slow: SlowSender | None = None,
    ) -> None:
        if not MIN_BYTES <= l0_bytes <= MAX_BYTES:
            raise CueError(f"compact superframe of {l0_bytes} bytes, {MIN_BYTES}..{MAX_BYTES}")
        self.voice = voice
        self._coding = coding_for(voice)
        self._size = l0_bytes
        self._options = options.in_language(self._coding.language)
        self._first = first
        self._signed = signed
        self._slow = slow or usual_sender(self._coding.language, self._coding.identity)
        self._score: Score | None = None
        self._writer: WindowWriter | None = None

    def encode(self, motion: Motion, index: int) -> Superframe:
        """Return superframe `index` of `motion`.

        Raises
        ------
        VoiceError
            If the motion was made with another voice.
        CueError
            If the motion has no score.
        """
        self.voice.check_motion(motion)
        if motion.score is None:
            raise CueError("a compact superframe holds a score, the motion has none")
        if self._writer is None or self._score is not motion.score:
            self._score = motion.score
            line = to_line(motion.score, self._options)
            self._writer = WindowWriter(
                line,
                self._options,
                self._coding.identity,
                self._size,
                first=self._first,
                signed=self._signed,
                slow=self._slow,
            )
        return Superframe(index, self._writer.l0(index), b"")
