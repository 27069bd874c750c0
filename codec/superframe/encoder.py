"""Encoding of superframes: analyse, plan, allocate, write.

Each room hands on one frozen value: `analysis` the content of a superframe, `plan`
its fields beside coefficients, `allocation` the steps of these; `payload` writes bytes.
Specification: spec/bitstream.md, section 2.
"""

from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.errors import CueError
from codec.superframe.allocation import allocate, choose, content_at, without_coefficients
from codec.superframe.analysis import Analysis, Analyst
from codec.superframe.checks import MIN_L0_BYTES, SIGNED_BYTES
from codec.superframe.coding import coding_for
from codec.superframe.filmed import is_filmed
from codec.superframe.filmed_encoder import FilmedEncoder
from codec.superframe.payload import (
    CRC8_BYTES,
    Content,
    read_l0,
    room_bits,
    write_l0,
    write_l0_whole,
    write_l1,
)
from codec.superframe.plan import plan_of, plans
from codec.superframe.slow_channel import SlowSender, usual_sender
from codec.superframe.superframe import Superframe

_FILMED_BYTES = 8
"""Least bytes of L0 in a filmed superframe: labels and a slow piece fit."""

_LEAST_S = 2.0
"""Length of a motion that says whether it was filmed."""


class SuperframeEncoder:
    """Encoder of superframes of constant size.

    Every superframe is a function of the motion and the index alone, so that they can be made
    in any order.

    Parameters
    ----------
    voice : Voice
        Of the motion.
    l0_bytes, l1_bytes : int
        Sizes of the parts, at least 5 and 0; checksums and header count.
    lead : int
        Lead on air before their time, in superframes, 0..3.
    options : CueingOptions
        Under which the receiver derives keys from phones.
    protected : bool
        Send previews of later superframes.
    signed : bool
        Leave room for a proof of who speaks (`codec.superframe.checks.with_proof`).
    slow : SlowSender, optional
        Sends lasting facts; default: language and coding of a voice that is not French.
    filmed : bool, optional
        Tell keys as labels, and weigh all uses of the prediction and all steps by the error that
        remains: for cuers whose movement the score predicts badly. Default: with `protected`, as
        a motion of 2 s or more asks (`codec.superframe.filmed.is_filmed`), else not.
    begin : int, optional
        First superframe on air; default: the one where the motion begins.

    Raises
    ------
    CueError
        If a size or the lead is out of range.

    Examples
    --------
    >>> from codec import load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> encoder = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=7)
    >>> frame = encoder.encode(motion_of(score_of_text("Oui"), voice), 0)
    >>> len(frame.l0), len(frame.l1)
    (20, 7)
    """

    def __init__(
        self,
        voice: Voice,
        *,
        l0_bytes: int,
        l1_bytes: int,
        lead: int = 2,
        options: CueingOptions = DEFAULT_OPTIONS,
        protected: bool = False,
        signed: bool = False,
        slow: SlowSender | None = None,
        filmed: bool | None = None,
        begin: int | None = None,
    ) -> None:
        if l0_bytes < MIN_L0_BYTES + SIGNED_BYTES * signed or l1_bytes < 0 or not 0 <= lead <= 3:
            raise CueError(f"superframe of {l0_bytes} + {l1_bytes} bytes, lead {lead}")
        self.voice = voice
        self._sizes = l0_bytes, l1_bytes
        self._coding = coding_for(voice)
        options = options.in_language(self._coding.language)
        slow = slow or usual_sender(self._coding.language, self._coding.identity)
        self._analysts = {
            seen: Analyst(
                self._coding, l0_bytes, lead, options, protected=protected, signed=signed,
                slow=slow, filmed=seen, begin=begin,
            )
            for seen in (False, True)
        }  # fmt: skip
        self._filmed_encoder = FilmedEncoder(
            voice, self._coding, self._analysts[True], self._sizes, begin
        )
        # Filmed motion needs room for its labels: in small superframes all counts as rule-based.
        few = l0_bytes < _FILMED_BYTES + SIGNED_BYTES * signed
        self._filmed = False if few or (filmed is None and not protected) else filmed
        self._decided: tuple[Motion, bool] | None = None

    def encode(self, motion: Motion, index: int) -> Superframe:
        """Return a superframe of the encoder's size.

        Parameters
        ----------
        motion : Motion
        index : int
            Its number: superframe k covers 0.64 s from 0.64 k s on.

        Returns
        -------
        Superframe

        Raises
        ------
        VoiceError
            If the motion was made with another voice.
        """
        if self._is_filmed(motion):
            self.voice.check_motion(motion)
            return self._filmed_encoder.encode(motion, index)
        analysis, bases = self._analysed(motion, index), self._coding.bases
        l0_bytes, l1_bytes = self._sizes
        room = room_bits(analysis.header, l0_bytes) + 8 * max(0, l1_bytes - CRC8_BYTES)
        for plan in plans(analysis, l0_bytes, l1_bytes):
            written = self._write(allocate(plan, bases, room), analysis)
            if written is not None:
                return written
        written = self._write(without_coefficients(plan_of(analysis, {}), bases), analysis)
        assert written is not None, "a fitted score always fits"
        return written

    def encode_at(self, motion: Motion, index: int, step: int) -> Superframe:
        """Return superframe `index` with the residual at a given step, in an L0 of any length.

        Parameters
        ----------
        motion : Motion
        index : int
        step : int
            Step number, 0 (finest) to 63 (no residual).

        Returns
        -------
        Superframe
        """
        analysis, bases = self._analysed(motion, index), self._coding.bases
        chosen = choose(analysis, bases, step)
        content = content_at(plan_of(analysis, analysis.previews), bases, chosen, step)
        return Superframe(index, write_l0_whole(content, bases, self._coding.identity), b"")

    def _analysed(self, motion: Motion, index: int) -> Analysis:
        """Return the content of superframe `index`; refuse a motion of another voice."""
        self.voice.check_motion(motion)
        return self._analysts[self._is_filmed(motion)].analyse(motion, index)

    def _is_filmed(self, motion: Motion) -> bool:
        """Return whether a motion is coded as a filmed one: a window of one says nothing of it."""
        if self._filmed is not None:
            return self._filmed
        if motion.score is None or motion.duration_s < _LEAST_S:
            return False
        if self._decided is None or self._decided[0] is not motion:
            self._decided = motion, is_filmed(motion, self.voice)
        return self._decided[1]

    def _write(self, content: Content, analysis: Analysis) -> Superframe | None:
        """Return the bytes of a superframe, None if L0 has no room for its content."""
        l0_bytes, l1_bytes = self._sizes
        bases = self._coding.bases
        l0 = write_l0(content, bases, l0_bytes, self._coding.identity, even=analysis.even)
        if l0 is None or l1_bytes == 0:
            return None if l0 is None else Superframe(analysis.index, l0, b"")
        _, known = read_l0(l0, bases, self._coding.language)
        l1 = write_l1(l0, content.setting, content.q, known, bases, l1_bytes)
        return Superframe(analysis.index, l0, l1)
