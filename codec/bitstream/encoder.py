"""Encoding of superframes: analyse, plan, allocate, write.

Each room hands on one frozen value: `analysis` says what is to be sent of a superframe, `plan`
what it says beside coefficients, `allocation` how finely these are told, `payload` writes bytes.
Specification: spec/bitstream.md, section 2.
"""

from codec.bitstream.allocation import allocate, allocate_at, error_mm, without_coefficients
from codec.bitstream.analysis import Analysis, Analyst
from codec.bitstream.bits import HEADER_BYTES
from codec.bitstream.coding import coding_for
from codec.bitstream.payload import (
    CRC8_BYTES,
    CRC16_BYTES,
    MIN_L0_BYTES,
    Content,
    read_l0,
    write_l0,
    write_l0_whole,
    write_l1,
)
from codec.bitstream.plan import plan_of, plans
from codec.bitstream.superframe import Superframe
from codec.cuer.motion import Motion
from codec.cuer.voice import Voice
from codec.cues.cueing import DEFAULT_OPTIONS, CueingOptions
from codec.errors import CueError


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
        Superframes by which they will be on air ahead of their time, 0..3.
    options : CueingOptions
        Under which the receiver derives keys from phones.
    protected : bool
        Send previews of later superframes.

    Raises
    ------
    CueError
        If a size or the lead is out of range.
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
    ) -> None:
        if l0_bytes < MIN_L0_BYTES or l1_bytes < 0 or not 0 <= lead <= 3:
            raise CueError(f"superframe of {l0_bytes} + {l1_bytes} bytes, lead {lead}")
        self.voice = voice
        self._sizes = l0_bytes, l1_bytes
        self._analyst = Analyst(coding_for(voice), l0_bytes, lead, options, protected=protected)

    def encode(self, motion: Motion, index: int) -> Superframe:
        """Return superframe `index` of `motion`, of the encoder's size.

        Raises
        ------
        VoiceError
            If the motion was made with another voice.
        """
        analysis = self._analyse(motion, index)
        l0_bytes, l1_bytes = self._sizes
        room = 8 * (l0_bytes - HEADER_BYTES - CRC16_BYTES + max(0, l1_bytes - CRC8_BYTES))
        for plan in plans(analysis, l0_bytes, l1_bytes):
            written = self._write(allocate(plan, room), analysis)
            if written is not None:
                return written
        written = self._write(without_coefficients(plan_of(analysis, {})), analysis)
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
        """
        analysis = self._analyse(motion, index)
        content = allocate_at(plan_of(analysis, analysis.previews), step)
        return Superframe(index, write_l0_whole(content, analysis.bases), b"")

    def error_mm(self, motion: Motion, index: int, step: int) -> float:
        """Return the error of superframe `index` at a step: RMS over its markers and frames."""
        return error_mm(self._analyse(motion, index), step)

    def _analyse(self, motion: Motion, index: int) -> Analysis:
        self.voice.check_motion(motion)
        return self._analyst.analyse(motion, index)

    def _write(self, content: Content, analysis: Analysis) -> Superframe | None:
        """Return the bytes of a superframe, None if L0 has no room for what it says."""
        l0_bytes, l1_bytes = self._sizes
        l0 = write_l0(content, analysis.bases, l0_bytes, even=analysis.even)
        if l0 is None or l1_bytes == 0:
            return None if l0 is None else Superframe(analysis.index, l0, b"")
        _, known = read_l0(l0, analysis.bases)
        l1 = write_l1(l0, content.setting, content.q, known, analysis.bases, l1_bytes)
        return Superframe(analysis.index, l0, l1)
