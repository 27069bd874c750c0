"""Decoding of superframes, in any order and with holes.

The decoder predicts from the neighbours that it knows, and conceals losses: without L1
the coarse residual stays, without L0 the hand finishes its key and goes to rest. Specification:
spec/bitstream.md, section 2.
"""

import numpy as np
from numpy.typing import NDArray

from codec.cuer.models.face import N_FACE_PARAMETERS
from codec.cuer.voice import Voice
from codec.cues.timeline import SUPERFRAME_S, TICKS
from codec.errors import BitstreamError, VoiceError
from codec.superframe.bits import PLAIN, SCORE, SEQUENCES, read_header
from codec.superframe.checks import is_compact, is_own, is_possible
from codec.superframe.coding import Coding, coding_for
from codec.superframe.fitting import Predict
from codec.superframe.foreign import ForeignStream
from codec.superframe.lips import LipContract
from codec.superframe.merging import MergedScore, Parts, join
from codec.superframe.payload import Content, read_l0, read_l1, read_record
from codec.superframe.preview import Preview, part_of_preview
from codec.superframe.quantise import NO_RESIDUAL, UNUSED, Setting, basis_of, dequantise
from codec.superframe.resynthesis.trajectory import minimum_jerk
from codec.superframe.score_coding import ScorePart
from codec.superframe.superframe import WINDOWS, DecodedSuperframe, resynthesis_of, scaled
from codec.superframe.tables import coefficient_tables
from codec.superframe.window import Window

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_HISTORY = 8
"""Superframes to either side that are remembered."""


class SuperframeDecoder:
    """Decoder of superframes in any order, with holes.

    It keeps a few superframes to predict from; results of other numbers do not depend on
    the order of arrival once the neighbours are known (`render`).

    Parameters
    ----------
    voice : Voice
    lips : bool
        Keep the lips to the phones' targets (`codec.superframe.lips`): for viewers; the bare
        parameters are those of the specification's vectors.
    draw : bool
        Whether to compute the motion; without it `params` have no frames, and scores cost a third.

    Examples
    --------
    >>> from codec import SuperframeEncoder, load_voice
    >>> from synth import motion_of, score_of_text
    >>> voice = load_voice("claire")
    >>> motion = motion_of(score_of_text("Oui"), voice)
    >>> frame = SuperframeEncoder(voice, l0_bytes=20, l1_bytes=7).encode(motion, 0)
    >>> decoder = SuperframeDecoder(voice)
    >>> decoder.take(frame.l0, frame.l1, 0)
    >>> decoder.render(0).params.shape
    (32, 31)
    """

    def __init__(self, voice: Voice, *, lips: bool = False, draw: bool = True) -> None:
        self.voice, self._draws = voice, draw
        self._lips = LipContract(voice) if lips else None
        self._coding = coding_for(voice)
        self._contents: dict[int, Content] = {}
        self._layers: dict[int, tuple[str, ...]] = {}
        self._previewed: dict[int, tuple[int, Preview]] = {}
        self._foreign = ForeignStream()

    def push(self, l0: bytes | None, l1: bytes | None, index: int) -> DecodedSuperframe:
        """Take the parts of superframe `index` and return what they say now.

        Parameters
        ----------
        l0, l1 : bytes or None
            None is a part that did not arrive; a part whose checksum is wrong counts as such.
        index : int
            Any number that is congruent to the header's sequence.

        Returns
        -------
        DecodedSuperframe

        Raises
        ------
        VoiceError
            If the stream was made with another voice or other coding tables.
        BitstreamError
            If L0 is intact and breaks a rule: version (H2), sequence (H4).
        """
        self.take(l0, l1, index)
        return self.render(index)

    def take(self, l0: bytes | None, l1: bytes | None, index: int) -> None:
        """Take the parts of a superframe without drawing it yet.

        Parameters
        ----------
        l0, l1, index
            As of `push`.
        """
        self._forget(index)
        content, layers = self._read(l0, l1, index)
        if content is not None:
            self._contents[index], self._layers[index] = content, layers
            for distance, preview in content.previews.items():
                # The nearest preview is the best one.
                known = self._previewed.get(index + distance)
                if known is None or abs(distance) <= known[0]:
                    self._previewed[index + distance] = abs(distance), preview

    def _forget(self, index: int) -> None:
        for old in [k for k in self._contents if abs(k - index) > _HISTORY]:
            del self._contents[old], self._layers[old]
        for old in [k for k in self._previewed if abs(k - index) > _HISTORY]:
            del self._previewed[old]

    def _read(
        self, l0: bytes | None, l1: bytes | None, index: int
    ) -> tuple[Content | None, tuple[str, ...]]:
        if l0 is None or not self.admits(l0):
            return None, ()
        header = read_header(l0)
        if header.sequence != index % header.sequences:
            raise BitstreamError(
                f"sequence number {header.sequence}, superframe {index} has "
                f"{index % header.sequences}",
                section="H4",
                bit=4,
            )
        content, known = read_l0(l0, self._coding.bases, self._coding.language)
        if l1:
            try:
                whole = read_l1(l0, l1, content, known, self._coding.bases)
            except BitstreamError:
                return content, ("L0",)
            return whole, ("L0", "L1")
        return content, ("L0",)

    def admits(self, l0: bytes) -> bool:
        """Return whether an L0 part is whole and of this decoder's coding (H5, M2).

        A single part that is not may be damaged, and so may two of equal bytes, as where a recorder
        wrote zeros; two different ones with the same other identity are another stream's (H6).

        Parameters
        ----------
        l0 : bytes

        Returns
        -------
        bool

        Raises
        ------
        VoiceError
            If the stream was made with another voice or other coding tables.
        BitstreamError
            If it is of another version (H2).
        """
        identity = self._coding.identity
        if is_own(l0, identity):
            read_header(l0)
            self._foreign.own()
            return True
        if not is_possible(l0):
            return False
        if not is_compact(l0) and not self._foreign.take(l0):
            return False
        read_header(l0)
        told = self._foreign.describe(l0)
        raise VoiceError(
            f"another voice, language or coding tables: {told + ', ' if told else ''}"
            f"the identity of voice {self.voice.name} here is {identity}"
        )

    def render(self, index: int) -> DecodedSuperframe:
        """Return superframe `index` from all that has arrived by now.

        Called when its time comes, the neighbours are known and the motion is the best possible.

        Parameters
        ----------
        index : int

        Returns
        -------
        DecodedSuperframe
        """
        parts = self._parts(index)
        content = self._contents.get(index)
        joined = join(parts)
        score = joined.score()
        begin, end = index * SUPERFRAME_S - 1e-6, (index + 1) * SUPERFRAME_S - 1e-6
        params = self._drawn(index, joined) if self._draws else self._coding.mean[None][:0]
        return DecodedSuperframe(
            index,
            index * SUPERFRAME_S,
            params.astype(np.float32),
            tuple(p for p in score.phones if begin <= p.start < end),
            tuple(k for k in score.keys if begin <= k.start < end),
            self._layers.get(index, ()),
            content is None,
            parts.get(index),
            content.header.lead if content else -1,
            index % SEQUENCES,
            content.slow if content else (),
        )

    def _drawn(self, index: int, joined: MergedScore) -> Array:
        """Return the parameters of a superframe as a viewer sees them, shape (32, P)."""
        params = self._told(index, joined) if self._tells(index) else self._untold(index, joined)
        if self._is_filmed(index):
            sides = (
                self._told(k, join(self._parts(k))) if self._is_filmed(k) else None
                for k in (index - 1, index + 1)
            )
            params = blended(params, *sides)
        if self._lips is not None:
            face, ticks = params[:, :N_FACE_PARAMETERS], index * TICKS + np.arange(float(TICKS))
            params[:, :N_FACE_PARAMETERS] = self._lips.kept(face, joined.spoken(), ticks)
        return params

    def _parts(self, index: int) -> Parts:
        """Return the scores around a superframe, from previews where it was lost."""
        reach = range(index - WINDOWS, index + 2)
        contents = {k: self._contents[k].part for k in reach if k in self._contents}
        windows = {k: part for k, part in contents.items() if isinstance(part, Window)}
        if windows and not isinstance(contents.get(index), ScorePart):
            return windows
        parts = {k: p for k in reach[-3:] if isinstance(p := contents.get(k), ScorePart)}
        for k in reach[-3:]:
            if k not in contents and k in self._previewed:
                parts[k] = part_of_preview(self._previewed[k][1], self._coding.language)
        return parts

    def _tells(self, index: int) -> bool:
        """Return whether anything is known about a superframe."""
        return index in self._contents or index in self._previewed

    def _is_filmed(self, index: int) -> bool:
        content = self._contents.get(index)
        return content is not None and content.header.filmed

    def _told(self, index: int, joined: MergedScore) -> Array:
        """Return the parameters of a superframe that arrived, or was previewed."""
        content = self._contents.get(index)
        if content is not None:
            return self._prediction(content, index, joined) + self._sent(content)
        before, after = (self._beyond(k) for k in (index - 1, index + 1))
        prediction = resynthesis_of(self._coding, joined, index).params()
        return prediction + self._coding.residual.between(before, after)

    def _beyond(self, index: int) -> Array | None:
        """Return the residual of a superframe with a score beyond its whole prediction."""
        content = self._contents.get(index)
        if content is None or content.header.mode != SCORE:
            return None
        joined = join(self._parts(index))
        params = self._prediction(content, index, joined) + self._sent(content)
        return np.asarray(params - resynthesis_of(self._coding, joined, index).params())

    def _untold(self, index: int, joined: MergedScore) -> Array:
        """Return likely parameters of a lost superframe.

        The hand finishes its key and, if the loss lasts, goes to rest.
        """
        # A score packet beside it says which keys to resynthesise.
        if any(isinstance(part, Window) for part in joined.parts.values()):
            return resynthesis_of(self._coding, joined, index).params()
        rest = resynthesis_of(self._coding, join({}), index).params()
        sides = [
            [k for k in range(index + side, index + side * _HISTORY, side) if self._tells(k)][:1]
            for side in (-1, 1)
        ]
        frames = np.arange(TICKS)
        distance = np.full(TICKS, 2 * TICKS)
        # Frames to the nearest received superframe on either side decide how far she is towards
        # rest.
        for found, place in zip(sides, (frames + 1, TICKS - frames), strict=True):
            for k in found:
                distance = np.minimum(distance, TICKS * (abs(k - index) - 1) + place)
        mean = self._coding.mean
        resting = minimum_jerk((distance - TICKS) / TICKS)[:, None]
        # Deviation from the mean at both borders, interpolated by the basis.
        before, after = (
            self._told(k, join(self._parts(k))) - mean if self._tells(k) else None
            for k in (index - 1, index + 1)
        )
        likely = self._coding.plain.between(before, after)
        return mean + resting * (rest - mean) + (1 - resting) * likely

    def _prediction(self, content: Content, index: int, joined: MergedScore) -> Array:
        if content.header.mode == PLAIN:
            return self._coding.mean
        setting = content.setting
        resynthesis = resynthesis_of(self._coding, joined, index)
        params = resynthesis.params(course=setting.course, shift=setting.shift)
        return scaled(params, self._coding, setting.shares)

    def _sent(self, content: Content) -> Array:
        return residual_of(content.setting, content.q, self._coding)


BLEND = np.array([0.4, 0.225, 0.1, 0.025])[:, None]
"""Parts of the jump at a border that the frames next to it take, the nearest first (Q7): of lengths
3 to 12, three slopes and five heights the least error on 8 takes of a real cuer."""


def blended(params: Array, before: Array | None, after: Array | None) -> Array:
    """Return a filmed superframe whose borders to filmed neighbours are smoothed (Q7).

    Parameters
    ----------
    params : ndarray of float64, shape (32, P)
    before, after : ndarray of float64, shape (32, P), or None
    """
    result = params.copy()
    if before is not None:
        result[: len(BLEND)] -= BLEND * _jump(before, params)
    if after is not None:
        result[-len(BLEND) :] += BLEND[::-1] * _jump(params, after)
    return result


def _jump(left: Array, right: Array) -> Array:
    """Return how far two superframes are apart in the middle between their frames, shape (P,)."""
    return np.asarray((3 * right[0] - right[1] - 3 * left[-1] + left[-2]) / 2)


def residual_of(setting: Setting, q: Ints, coding: Coding) -> Array:
    """Return the residual that a superframe says."""
    basis = basis_of(coding.bases, setting)
    if setting.step == NO_RESIDUAL:
        return np.zeros((TICKS, len(basis.matrix)))
    return basis.backward(dequantise(q, setting, basis, coefficient_tables()))


def block_of(payload: bytes, predict: Predict | None, coding: Coding) -> Array:
    """Return the parameters of a superframe whose score is elsewhere (F7), shape (32, P).

    Parameters
    ----------
    payload : bytes
    predict : callable or None
        Its prediction by course and shift; None without a score.
    coding : Coding
    """
    setting, q = read_record(payload, PLAIN if predict is None else SCORE, coding.bases)
    return likely_block(setting, predict, coding) + residual_of(setting, q, coding)


def likely_block(setting: Setting, predict: Predict | None, coding: Coding) -> Array:
    """Return the used part of a superframe's prediction (P8, P10), shape (32, P)."""
    if predict is None or setting.shares == UNUSED:
        return np.tile(coding.mean, (TICKS, 1))
    return scaled(predict(setting.course, setting.shift), coding, setting.shares)
